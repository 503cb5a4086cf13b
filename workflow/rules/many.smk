# Many plays, and one play many times: the season's table, an ensemble's members and bands.


rule season:
    input:
        bundles=expand("results/{play}/bundle/{play}.zip", play=SEASON),
        code=code("season"),
    output:
        "results/plays.csv",
        "results/index.html",
    log:
        "results/season.log",
    params:
        plays=" ".join(SEASON),
    message:
        "every play in one table and on one page"
    shell:
        "replay season {params.plays} 2>&1 | tee {log}"


rule ensembles:
    input:
        lambda wildcards: expand(
            "results/{ensemble}/bands/manifest.json", ensemble=ensembles()
        ),


rule member_settings:
    input:
        settings="results/{play}/settings/manifest.json",
        code=code("settings"),
    output:
        "results/{play}.{ensemble}/{member}/settings/manifest.json",
    log:
        "results/{play}.{ensemble}/{member}/logs/settings.log",
    wildcard_constraints:
        play=PLAY,
        ensemble=PLAY,
        member="[0-9]+",
    group:
        "prepare"
    params:
        ensemble=ensemble_file,
        # of the whole description only what concerns this member
        member=lambda wildcards: repr(
            members(f"{wildcards.play}.{wildcards.ensemble}")[wildcards.member]
        ),
    message:
        "{wildcards.play}.{wildcards.ensemble}/{wildcards.member}: replace what the ensemble varies"
    shell:
        "replay settings {wildcards.play}.{wildcards.ensemble}/{wildcards.member} --ensemble {params.ensemble}"
        " 2>&1 | tee {log}"


rule bands:
    input:
        of_members=lambda wildcards: expand(
            "results/{play}.{ensemble}/{member}/{stage}/manifest.json",
            play=wildcards.play,
            ensemble=wildcards.ensemble,
            member=members(f"{wildcards.play}.{wildcards.ensemble}"),
            stage=[
                "settings",
                "replay",
                *(["fidelity"] if recorded(wildcards) else []),
                "measures",
            ],
        ),
        of_play="results/{play}/measures/manifest.json",
        code=code("bands"),
    output:
        "results/{play}.{ensemble}/bands/manifest.json",
    log:
        "results/{play}.{ensemble}/logs/bands.log",
    wildcard_constraints:
        play=PLAY,
        ensemble=PLAY,
    params:
        ensemble=ensemble_file,
    message:
        "{wildcards.play}.{wildcards.ensemble}: bands of every measure over the members"
    shell:
        "replay bands {wildcards.play}.{wildcards.ensemble} --ensemble {params.ensemble} 2>&1 | tee {log}"
