"""How long a report page of 10 000 points takes to open in Chromium: until the first figure is drawn, and how long the
page's own thread is busy until then, which does not depend on what else the machine does.

    python benchmarks/report_page.py [times]

The curves are those of a real response, repeated until there are 10 000 points, with their motions and multipliers.
"""

import sys
import tempfile
import time
from contextlib import closing
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))

import chromium
import numpy as np
import xarray

import suboctave as so

POINTS, CURVES = 10_000, 5


def repeated(data: xarray.Dataset, number: int) -> xarray.Dataset:
    """A curve with so many points that all have together `POINTS`: the values between those of `data` are near."""
    which = np.sort(np.resize(np.arange(data.sizes["point"]), POINTS // CURVES))
    longer = data.isel(point=which)
    spread = np.interp(np.arange(which.size), np.flatnonzero(np.diff(which, prepend=-1)), data["omega"].to_numpy())
    after = np.searchsorted(which, data["event_after"].to_numpy())
    return longer.assign_coords(omega=("point", spread)).assign(
        event_after=("event", after), amplitude=longer["amplitude"] * (1.0 + 0.05 * number)
    )


def main() -> None:
    """Make the page, and time it as often as asked for."""
    system = so.library.reference_oscillator(p=0.55, j=0.0, regularization=3000.0)
    data = so.frequency_response(system, omega=(4.5, 1.3)).to_xarray(motions=True)
    with tempfile.TemporaryDirectory() as folder:
        begin = time.perf_counter()
        curves = {f"curve {i}": repeated(data, i) for i in range(CURVES)}
        path = so.write_report(curves, Path(folder) / "page.html")
        written = time.perf_counter() - begin
        print(f"{POINTS} points, {path.stat().st_size / 1e6:.1f} MB, written in {written:.1f} s")
        for i in range(int(sys.argv[1]) if len(sys.argv) > 1 else 3):
            with closing(chromium.Page(Path(folder) / f"profile {i}")) as page:
                page.call("Performance.enable", timeDomain="threadTicks")
                page.open(path.as_uri())
                page.wait("performance.getEntriesByName('figure drawn').length")
                first = page.script("performance.getEntriesByName('figure drawn')[0].startTime") / 1e3
                metrics = page.call("Performance.getMetrics")["metrics"]
                busy = next(one["value"] for one in metrics if one["name"] == "ThreadTime")
                begin = time.perf_counter()
                page.click_on("#curve-0 tbody button")
                page.wait("document.querySelectorAll('#panel .small').length === 4")
                filled = time.perf_counter() - begin
                print(f"first figure drawn after {first:.2f} s (busy {busy:.2f} s), panel filled in {filled:.2f} s")


if __name__ == "__main__":
    main()
