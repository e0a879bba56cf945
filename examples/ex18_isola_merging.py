"""Where an isola merges: beside the place where the period doublings end, and not there.

Between gaps of 0.1740 and 0.1772 the two period doublings of the response approach one another and vanish, and the
large motions of twice the period come off. These are two events. Up to j = 0.17683 the doublings are joined through the
large motions. From there on a bubble joins them directly, and the large motions are a closed branch of their own. At
j = 0.17713 the bubble shrinks to nothing, which the isola does not notice.

    python ex18_isola_merging.py [figure.png]
"""

from matplotlib.figure import Figure

import suboctave as so
from suboctave.pictures import figure_file, save_figure

GAPS = (0.1740, 0.1760, 0.1768, 0.17682, 0.1769, 0.1771, 0.1772)
RANGE = (2.1, 2.0)
WINDOW = (2.0165, 2.0415)
MERGING = 0.176829  # by shooting
system = so.library.reference_oscillator(p=0.55, regularization=3000.0)

responses = [so.frequency_response(system.with_parameters({"j": gap}), RANGE) for gap in GAPS]
# the large motions at omega = 2.1: followed there from a doubling at the first gap, then over the gap
large = so.switch_branch(responses[0].bifurcations["PD"][-1], bounds=RANGE[::-1]).orbits[-1]
drawn = []
for gap, response in zip(GAPS, responses, strict=True):
    over = so.continue_branch(large, "j", (GAPS[0], gap)).orbits[-1] if gap != GAPS[0] else large
    upper = so.continue_branch(over, "omega", RANGE, max_step=0.03)
    doublings = response.bifurcations["PD"]
    beside = [so.switch_branch(doublings[0], bounds=RANGE, max_step=0.03)] if doublings else []
    drawn.append([response, upper, *beside])
    joined = "a doubling of the response" if upper.arrives else "no doubling"
    print(f"j = {gap:g}: {len(doublings)} doublings, the large motions lead to {joined}")
    # below the merging they come from the lower doubling, above it they turn back at a limit point
    assert (upper.arrives is not None) == (gap < MERGING), gap
    if beside and gap > MERGING:  # the bubble
        assert beside[0].arrives is not None, gap

figure = Figure(figsize=(11.0, 5.6), layout="constrained")
frames = figure.subplots(2, 4, sharex=True, sharey=True).ravel()
legend = {}
for axes, gap, branches in zip(frames, GAPS, drawn, strict=False):
    so.plot(branches, ax=axes, xlim=WINDOW, ylim=(0.165, 0.265), marks=["LP", "PD"])
    own = axes.get_legend()
    legend |= dict(zip((text.get_text() for text in own.get_texts()), own.legend_handles, strict=True))
    own.remove()
    axes.set_title(f"j = {gap:g}")
    axes.label_outer()
frames[-1].axis("off")
frames[-1].legend(legend.values(), legend.keys(), loc="center")
save_figure(figure, figure_file(), dpi=150)

# The doublings vanish at j = 0.177129 (shooting), 0.0003 above the merging.
assert [len(response.bifurcations["PD"]) > 0 for response in responses] == [gap < 0.177129 for gap in GAPS]
