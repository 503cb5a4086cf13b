# The verdict, the page a person reads, and the bundle another laboratory checks.


rule verdict:
    input:
        stages=evidence(),
        code=code("verdict"),
    output:
        stage("verdict"),
    log:
        log("verdict"),
    benchmark:
        cost("verdict")
    group:
        "finish"
    resources:
        mem_mb=memory,
        runtime=10,
    message:
        "{wildcards.play}: collect the gates into one verdict"
    shell:
        "replay judge {wildcards.play} 2>&1 | tee {log}"


rule report:
    input:
        stages=evidence("verdict"),
        code=code("report"),
    output:
        manifest=stage("report"),
        page=report(
            "results/{play}/report/report.html",
            caption="../report/page.rst",
            category="Replay",
            labels={"play": "{play}", "what": "report"},
        ),
    log:
        log("report"),
    benchmark:
        cost("report")
    group:
        "finish"
    resources:
        mem_mb=memory,
        runtime=20,
    message:
        "{wildcards.play}: write the report"
    shell:
        "replay report {wildcards.play} 2>&1 | tee {log}"


rule seal:
    input:
        play=description,
        stages=evidence("verdict", "report"),
        lock="environment.lock",
        code=code("seal"),
    output:
        bundle="results/{play}/bundle/{play}.zip",
        digest="results/{play}/bundle/{play}.zip.sha256",
    log:
        log("seal"),
    benchmark:
        cost("seal")
    group:
        "finish"
    resources:
        mem_mb=memory,
        runtime=10,
    params:
        plays=folder_of_plays,
    message:
        "{wildcards.play}: seal the bundle"
    shell:
        "replay seal {wildcards.play} --plays {params.plays} 2>&1 | tee {log}"
