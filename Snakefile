# From a play to a sealed bundle. Rules only name files, resources and one `replay` command each.


# ---------------------------------------------------------------- configuration
configfile: "config/config.yaml"


include: "workflow/rules/common.smk"


# One environment for every rule: the locked one. The recipe beside it builds the same as a container.
container: "container/replay.sif"


# A play, or a member of an ensemble of it: demo.friction/003.
wildcard_constraints:
    play=rf"{PLAY}(\.{PLAY}/[0-9]+)?",


localrules:
    all,
    write_out,
    season,
    ensembles,
    bands,


# ---------------------------------------------------------------- targets
rule all:
    input:
        expand("results/{play}/bundle/{play}.zip", play=config["plays"]),


# ---------------------------------------------------------------- stages, in the order of the protocol
include: "workflow/rules/reconstruction.smk"
include: "workflow/rules/model.smk"
include: "workflow/rules/replay.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/many.smk"


share_compiled_kernels()


onstart:
    hold_results_lock()


# A play that failed keeps the season's table from being a job's: what there is, is written all the same.
onerror:
    shell(f"replay season {' '.join(SEASON)}")
