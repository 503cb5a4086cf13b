"""From one football play to a sealed finite-element replay of its impact."""

import os

# on another number of threads dense linear algebra sums in another order; on matrices this small they cost time, too
os.environ["OPENBLAS_NUM_THREADS"] = "1"

__version__ = "0.1.0"
