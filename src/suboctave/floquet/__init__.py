"""Is it stable: one solved motion in; Floquet multipliers, an error estimate and a verdict out."""
