# Head, helmet, their readiness, and the decks for other solvers.


rule assemble:
    input:
        settings=stage("settings"),
        inputs=stage("inputs"),
        code=code("stages/assemble.py", "stages/frame.py", "models", "gates"),
    output:
        stage("assembly"),
    log:
        log("assemble"),
    benchmark:
        "results/{play}/logs/assemble.benchmark.tsv"
    resources:
        mem_mb=2000,
        runtime=20,
    message:
        "{wildcards.play}: build the head and helmet, check the helmet and the assembly"
    shell:
        "replay assemble {wildcards.play} --carry-on 2>&1 | tee {log}"


rule place:
    input:
        settings=stage("settings"),
        assembly=stage("assembly"),
        driver=stage("driver"),
        code=code(
            "stages/placement.py",
            "stages/players.py",
            "stages/collision.py",
            "stages/problem.py",
            "stages/frame.py",
            "models",
            "solver/contact",
            "gates",
        ),
    output:
        stage("placement"),
    log:
        log("place"),
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
        assembly=stage("assembly"),
        code=code(
            "stages/shake.py",
            "stages/frame.py",
            "stages/problem.py",
            "models",
            "solver",
            "gates",
        ),
    output:
        stage("shake"),
    log:
        log("shake"),
    benchmark:
        "results/{play}/logs/shake.benchmark.tsv"
    threads: workflow.cores
    resources:
        mem_mb=4000,
        runtime=60,
    message:
        "{wildcards.play}: shake the helmet alone"
    shell:
        "replay shake {wildcards.play} --threads {threads} --carry-on 2>&1 | tee {log}"


rule decks:
    input:
        settings=stage("settings"),
        assembly=stage("assembly"),
        driver=stage("driver"),
        placement=placement,
        code=code("stages/decks.py", "stages/frame.py", "decks", "models"),
    output:
        stage("decks"),
    log:
        log("decks"),
    message:
        "{wildcards.play}: write the run decks for other solvers"
    shell:
        "replay decks {wildcards.play} --carry-on 2>&1 | tee {log}"
