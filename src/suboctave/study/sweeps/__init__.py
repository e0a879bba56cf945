"""Sweeps: a study at many values of its parameters, on all cores or a cluster, as one labelled dataset."""
