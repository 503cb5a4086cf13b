"""Contact by Lagrange multipliers on velocities.

`settings` says what a user may choose, `surface` what can touch, `search` who may meet whom; `contact` runs
the step, `projection` clears a model of initial penetration. The numbers are in ``kernels/contact_*``.
"""

from replay.solver.contact.settings import ContactControls, ContactPair

__all__ = ["ContactControls", "ContactPair"]
