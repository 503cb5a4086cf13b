# The explicit replay, its sensitivity to hourglass control, and what was measured on it.


rule impact:
    input:
        settings=stage("settings"),
        assembly=stage("assembly"),
        driver=stage("driver"),
        placement=placement,
        shake=stage("shake"),
        code=code(
            "stages/impact.py",
            "stages/frame.py",
            "stages/problem.py",
            "stages/players.py",
            "stages/collision.py",
            "models",
            "solver",
            "measures",
            "gates",
        ),
    output:
        stage("replay"),
    log:
        log("impact"),
    benchmark:
        "results/{play}/logs/impact.benchmark.tsv"
    threads: workflow.cores
    resources:
        mem_mb=8000,
        runtime=1440,
    message:
        "{wildcards.play}: replay the impact"
    shell:
        "replay impact {wildcards.play} --threads {threads} --carry-on 2>&1 | tee {log}"


rule sensitivity:
    input:
        settings=stage("settings"),
        assembly=stage("assembly"),
        driver=stage("driver"),
        placement=placement,
        shake=stage("shake"),
        replay=stage("replay"),
        code=code(
            "stages/sensitivity.py",
            "stages/frame.py",
            "stages/problem.py",
            "stages/players.py",
            "stages/collision.py",
            "models",
            "solver",
            "measures",
            "gates",
        ),
    output:
        stage("sensitivity"),
    log:
        log("sensitivity"),
    benchmark:
        "results/{play}/logs/sensitivity.benchmark.tsv"
    threads: workflow.cores
    resources:
        mem_mb=8000,
        runtime=1440,
    message:
        "{wildcards.play}: the same replay at half the hourglass coefficient"
    shell:
        "replay sensitivity {wildcards.play} --threads {threads} --carry-on 2>&1 | tee {log}"


rule fidelity:
    input:
        settings=stage("settings"),
        driver=stage("driver"),
        placement=placement,
        replay=stage("replay"),
        code=code("stages/fidelity.py", "stages/frame.py", "measures", "gates"),
    output:
        stage("fidelity"),
    log:
        log("fidelity"),
    message:
        "{wildcards.play}: compare the applied motion with the target"
    shell:
        "replay fidelity {wildcards.play} --carry-on 2>&1 | tee {log}"


rule measure:
    input:
        settings=stage("settings"),
        assembly=stage("assembly"),
        placement=placement,
        replay=stage("replay"),
        sensitivity=stage("sensitivity"),
        code=code("stages/measure.py", "stages/frame.py", "measures", "models"),
    output:
        stage("measures"),
    log:
        log("measure"),
    resources:
        mem_mb=2000,
        runtime=20,
    message:
        "{wildcards.play}: measure the head, the brain and the mechanical action"
    shell:
        "replay measure {wildcards.play} --carry-on 2>&1 | tee {log}"
