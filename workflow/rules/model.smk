# Head, helmet, their readiness, and the decks for other solvers.


rule assemble:
    input:
        settings=stage("settings"),
        helmet=helmet_files,
        code=code("assemble"),
    output:
        stage("assembly"),
    log:
        log("assemble"),
    benchmark:
        cost("assemble")
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=20,
    message:
        "{wildcards.play}: build the head and helmet, check the helmet and the assembly"
    shell:
        "replay assemble {wildcards.play} --carry-on 2>&1 | tee {log}"


rule place:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        driver=of("driver"),
        code=code("placement"),
    output:
        stage("placement"),
    log:
        log("place"),
    group:
        "prepare"
    resources:
        mem_mb=2000,
        runtime=20,
    message:
        "{wildcards.play}: bring two players to first contact"
    shell:
        "replay place {wildcards.play} --carry-on 2>&1 | tee {log}"


rule shake:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        code=code("shake"),
    output:
        stage("shake"),
    log:
        log("shake"),
    benchmark:
        cost("shake")
    # killed or out of time, it goes on from its checkpoint
    retries: 3
    threads: solver_threads
    resources:
        checkpoint_s=CHECKPOINT_S,
        mem_mb=memory,
        runtime=60,
    message:
        "{wildcards.play}: shake the helmet alone"
    shell:
        "replay shake {wildcards.play} --threads {threads} --checkpoint-every {resources.checkpoint_s} --carry-on 2>&1 | tee {log}"


rule decks:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        driver=of("driver"),
        placement=placement,
        code=code("decks"),
    output:
        stage("decks"),
    log:
        log("decks"),
    benchmark:
        cost("decks")
    group:
        "prepare"
    resources:
        mem_mb=memory,
        runtime=10,
    message:
        "{wildcards.play}: write the run decks for other solvers"
    shell:
        "replay decks {wildcards.play} --carry-on 2>&1 | tee {log}"
