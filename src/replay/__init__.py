"""From one football play to a sealed finite-element replay of its impact."""

__version__ = "0.1.0"
