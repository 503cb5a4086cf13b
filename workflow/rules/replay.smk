# The explicit replay, its sensitivity to hourglass control, and what was measured on it.


rule impact:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        driver=of("driver"),
        placement=placement,
        shake=of("shake"),
        code=code("impact"),
    output:
        stage("replay"),
    log:
        log("impact"),
    benchmark:
        cost("impact")
    # killed or out of time, it goes on from its checkpoint
    retries: 3
    threads: solver_threads
    resources:
        checkpoint_s=CHECKPOINT_S,
        mem_mb=memory,
        runtime=minutes,
    message:
        "{wildcards.play}: replay the impact"
    shell:
        "replay impact {wildcards.play} --threads {threads} --checkpoint-every {resources.checkpoint_s} --carry-on 2>&1 | tee {log}"


rule sensitivity:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        driver=of("driver"),
        placement=placement,
        shake=of("shake"),
        replay=stage("replay"),
        code=code("sensitivity"),
    output:
        stage("sensitivity"),
    log:
        log("sensitivity"),
    benchmark:
        cost("sensitivity")
    # killed or out of time, it goes on from its checkpoint
    retries: 3
    threads: solver_threads
    resources:
        checkpoint_s=CHECKPOINT_S,
        mem_mb=memory,
        runtime=minutes,
    message:
        "{wildcards.play}: the same replay at half the hourglass coefficient"
    shell:
        "replay sensitivity {wildcards.play} --threads {threads} --checkpoint-every {resources.checkpoint_s} --carry-on 2>&1 | tee {log}"


rule fidelity:
    input:
        settings=stage("settings"),
        driver=of("driver"),
        placement=placement,
        replay=stage("replay"),
        code=code("fidelity"),
    output:
        stage("fidelity"),
    log:
        log("fidelity"),
    benchmark:
        cost("fidelity")
    group:
        "finish"
    resources:
        mem_mb=memory,
        runtime=10,
    message:
        "{wildcards.play}: compare the applied motion with the target"
    shell:
        "replay fidelity {wildcards.play} --carry-on 2>&1 | tee {log}"


rule measure:
    input:
        settings=stage("settings"),
        assembly=of("assembly"),
        placement=placement,
        replay=stage("replay"),
        sensitivity=of("sensitivity"),
        code=code("measure"),
    output:
        stage("measures"),
    log:
        log("measure"),
    benchmark:
        cost("measure")
    group:
        "finish"
    resources:
        mem_mb=memory,
        runtime=20,
    message:
        "{wildcards.play}: measure the head, the brain and the mechanical action"
    shell:
        "replay measure {wildcards.play} --carry-on 2>&1 | tee {log}"
