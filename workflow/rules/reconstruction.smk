# The play, its raw tracks, and the motion they show.


rule settings:
    input:
        play=f"{PLAYS}/{{play}}/play.yaml",
        code=code("stages/settings.py", "stages/frame.py", "gates", "models"),
    output:
        stage("settings"),
    log:
        log("settings"),
    params:
        plays=folder_of_plays,
        resolution=config.get("resolution") or "as-the-play-says",
    message:
        "{wildcards.play}: check and resolve the play's settings"
    shell:
        "replay settings {wildcards.play} --plays {params.plays} --resolution {params.resolution} 2>&1 | tee {log}"


rule inputs:
    input:
        settings=stage("settings"),
        play=f"{PLAYS}/{{play}}/play.yaml",
        tracks=play_files,
        code=code("stages/inputs.py", "stages/frame.py", "motion"),
    output:
        stage("inputs"),
    log:
        log("inputs"),
    params:
        plays=folder_of_plays,
    message:
        "{wildcards.play}: check the raw tracks and keep copies with their hashes"
    shell:
        "replay inputs {wildcards.play} --plays {params.plays} 2>&1 | tee {log}"


rule reconstruct:
    input:
        settings=stage("settings"),
        inputs=stage("inputs"),
        code=code("stages/reconstruct.py", "stages/frame.py", "motion", "gates"),
    output:
        stage("reconstruction"),
    log:
        log("reconstruct"),
    benchmark:
        "results/{play}/logs/reconstruct.benchmark.tsv"
    resources:
        mem_mb=1000,
        runtime=20,
    message:
        "{wildcards.play}: reconstruct the six degrees of freedom of the skull CG"
    shell:
        "replay reconstruct {wildcards.play} --carry-on 2>&1 | tee {log}"


rule drive:
    input:
        settings=stage("settings"),
        reconstruction=stage("reconstruction"),
        code=code("stages/drive.py", "stages/frame.py", "motion"),
    output:
        stage("driver"),
    log:
        log("drive"),
    message:
        "{wildcards.play}: resample the motion for the solver"
    shell:
        "replay drive {wildcards.play} --carry-on 2>&1 | tee {log}"
