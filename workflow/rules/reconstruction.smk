# The play, its raw tracks, and the motion they show.


rule write_out:
    input:
        tracks=play_files,
        code=code("write_out"),
    output:
        f"{WRITTEN_OUT}/{{play}}/play.yaml",
    log:
        "results/{play}/logs/write_out.log",
    wildcard_constraints:
        play=PLAY,
    params:
        table=TABLE,
        plays=PLAYS,
        row=row_of,
        into=lambda wildcards, output: Path(output[0]).parents[1].as_posix(),
    message:
        "{wildcards.play}: write its row of the table as a play of its own"
    shell:
        "replay write-out {wildcards.play} --table {params.table} --plays {params.plays} --into {params.into}"
        " 2>&1 | tee {log}"


rule settings:
    input:
        play=description,
        code=code("settings"),
    output:
        stage("settings"),
    log:
        log("settings"),
    benchmark:
        cost("settings")
    wildcard_constraints:
        play=PLAY,
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=10,
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
        play=description,
        tracks=play_files,
        code=code("inputs"),
    output:
        stage("inputs"),
    log:
        log("inputs"),
    benchmark:
        cost("inputs")
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=10,
    params:
        plays=folder_of_plays,
    message:
        "{wildcards.play}: check the raw tracks and keep copies with their hashes"
    shell:
        "replay inputs {wildcards.play} --plays {params.plays} 2>&1 | tee {log}"


rule reconstruct:
    input:
        settings=stage("settings"),
        inputs=of("inputs"),
        code=code("reconstruct"),
    output:
        stage("reconstruction"),
    log:
        log("reconstruct"),
    benchmark:
        cost("reconstruct")
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=20,
    message:
        "{wildcards.play}: reconstruct the six degrees of freedom of the skull CG"
    shell:
        "replay reconstruct {wildcards.play} --carry-on 2>&1 | tee {log}"


rule drive:
    input:
        settings=stage("settings"),
        reconstruction=reconstruction,
        code=code("drive"),
    output:
        stage("driver"),
    log:
        log("drive"),
    benchmark:
        cost("drive")
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=10,
    message:
        "{wildcards.play}: resample the motion for the solver"
    shell:
        "replay drive {wildcards.play} --carry-on 2>&1 | tee {log}"
