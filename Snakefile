# From a play to a sealed bundle. Rules only name files, resources and one `replay` command each.


# ---------------------------------------------------------------- configuration
configfile: "config/config.yaml"


include: "workflow/rules/common.smk"


# One environment for every rule: the locked one. The recipe beside it builds the same as a container.
container: "container/replay.sif"


wildcard_constraints:
    play=r"[a-z0-9_-]+",


localrules:
    all,
    settings,
    inputs,
    drive,
    decks,
    fidelity,
    verdict,
    seal,


# ---------------------------------------------------------------- targets
rule all:
    input:
        expand("results/{play}/bundle/{play}.zip", play=config["plays"]),


# ---------------------------------------------------------------- stages, in the order of the protocol
include: "workflow/rules/reconstruction.smk"
include: "workflow/rules/model.smk"
include: "workflow/rules/replay.smk"
include: "workflow/rules/report.smk"


onstart:
    hold_results_lock()
