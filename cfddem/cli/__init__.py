"""The command line."""

import os

# NumPy's library for matrices shares small products among all processors: the tables of the self-disturbance then take
# several times the processor time, and longer. It reads this when it is loaded; a user's own choice stays.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
