"""Material laws, one file each: parameters, state layout, update, moduli.

A law is a module with

``NAME``
    The word used in model files.
``Parameters``
    Frozen dataclass, units in the field names; ``constants()`` gives the numbers of the kernel.
    It raises ``ValueError`` with a sentence for values that make no sense.
``STATE``
    Names of the state variables kept per element besides the stress. They start at zero, or at the values of
    ``Parameters.initial_state()`` where the law has that method.
``FIELDS``
    Optional: state variables that outputs show, by the name they have there.
``TOTAL_FORM``
    Whether the law looks at the deformation gradient.
``INITIAL_STRESS``
    Whether a run may begin with a stress, that is, whether the stress is a state of its own.
``HOURGLASS_YIELDS``
    Left out by laws whose hourglass forces are elastic; true where `update` returns `YieldingModuli`.
``N_CONSTANTS``
    How many numbers ``constants()`` gives.
``update(motion, stress, state, dt, p)``
    Scalar, branch-free; returns stress, state and `Moduli`.
``small_update``
    Optional: a cheaper `update` for small steps. It leaves its last state variable negative where a step was too
    large for it; the lane loop then takes `update` for that element.

`replay.solver.materials` lists them; adding a law touches that list and nothing else.
"""
