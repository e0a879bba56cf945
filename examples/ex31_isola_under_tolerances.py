"""How likely is an isolated resonance when gap and contact stiffness scatter about their nominal values?

The rattling oscillator has an isolated resonance of twice the period at gaps below 0.58. Gap and stiffness are drawn
from their tolerances (study_tolerances.toml), and each oscillator is searched for the isola under its load. The share
that has it estimates the probability, with Wilson's interval. The curve of births in the plane of gap and stiffness,
one continuation, gives the same probability by an integral, since the isola is there exactly below it.

    python ex31_isola_under_tolerances.py [figure.png] [--draws 1000]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import binomtest, norm

import suboctave as so
from suboctave.pictures import figure_file

arguments = sys.argv[1:]
draws = 2  # for an interval of 0.06 it takes 1000, and half an hour on two cores
if "--draws" in arguments:
    place = arguments.index("--draws")
    draws = int(arguments[place + 1])
    del arguments[place : place + 2]

study = Path(__file__).with_name("study_tolerances.toml")
sweep = so.sweep(study, draws=draws, sampling="random", progress=True)
print(sweep)
load = 0.55
there = ((sweep["isolas.from"] <= load) & (load <= sweep["isolas.to"])).any(axis=1)
interval = binomtest(int(there.sum()), draws).proportion_ci(0.95, method="wilson")
print(f"{there.sum()} of {draws} oscillators have the isola: between {interval.low:.3f} and {interval.high:.3f}")

# The birth of the isola over the gap, followed over the stiffness.
system = so.library.reference_oscillator(p=load, j=0.58, Kc=4.7)
(isola,) = so.find_isolas(system, (2.25, 2.45), "j", (0.57, 0.59), harmonics=7, values=2)
births = so.track(isola.born, "Kc", (4.5, 4.9), max_step=0.05)
order = np.argsort(births.parameter("Kc"))
stiffness, gap = births.parameter("Kc")[order], births.parameter("j")[order]
share = norm.cdf(gap, 0.58, 0.015)
probability = float(np.sum(np.diff(stiffness) * 0.5 * (share[1:] + share[:-1])) / 0.4)
print(f"probability by the curve of births: {probability:.4f}")

figure = Figure(figsize=(5.2, 3.6), layout="constrained")
axes = figure.subplots()
axes.plot(stiffness, gap, color="black", label="births of the isola")
axes.plot(sweep["Kc"][there], sweep["j"][there], "o", label="isola")
axes.plot(sweep["Kc"][~there], sweep["j"][~there], "o", mfc="none", label="none")
axes.set(xlabel="contact stiffness Kc", ylabel="gap j", title=f"P = {interval.low:.2f} to {interval.high:.2f}")
axes.legend()
figure.savefig(figure_file(), dpi=150)

# Each draw has the isola if and only if its gap lies below the curve of births.
assert np.array_equal(there, sweep["j"] < np.interp(sweep["Kc"], stiffness, gap))
assert not sweep.failures
assert interval.low < probability < interval.high
# Gauss-Legendre quadrature over 4 births, each by a search of its own with 15 harmonics, gives this probability.
assert abs(probability - 0.52534) < 5e-4, probability
