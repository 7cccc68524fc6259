"""What `sidestep run` leaves, as pandas frames, trajectories and plots.

Needs pandas, and for plots Matplotlib (Debian: python3-pandas, python3-matplotlib).
"""

from __future__ import annotations  # pandas and Matplotlib need not be there

import json
import pathlib
import sqlite3
from os import PathLike
from typing import TYPE_CHECKING, Any, Iterator, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from ._core import Trajectory

if TYPE_CHECKING:
    import pandas
    from matplotlib.figure import Figure


class Run:
    """A run's folder. What its series and columns are: docs/reference/command.md."""

    folder: pathlib.Path

    def __init__(self, folder: Union[str, PathLike[str]]) -> None:
        """Raises FileNotFoundError where the folder has no results."""
        self.folder = pathlib.Path(folder)
        self._file = self.folder / "results.sqlite"
        if not self._file.is_file():
            raise FileNotFoundError(f"{self._file}: there is no run in this folder")

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r})"

    def _rows(self, query: str, *values: Any) -> list[tuple[Any, ...]]:
        database = sqlite3.connect(self._file.resolve().as_uri() + "?mode=ro", uri=True)
        try:
            return database.execute(query, values).fetchall()
        except sqlite3.DatabaseError as error:
            raise ValueError(f"{self._file}: {error}") from error
        finally:
            database.close()

    @property
    def summary(self) -> dict[str, Any]:
        """summary.json, as a dict."""
        summary: dict[str, Any] = json.loads((self.folder / "summary.json").read_text())
        return summary

    @property
    def provenance(self) -> dict[str, Any]:
        """What ran where: version, git_hash, cpu, seed, ..."""
        return {key: value for key, value in self._rows("SELECT key, value FROM provenance")}

    @property
    def series(self) -> list[str]:
        """Names of the tables."""
        return [name for (name,) in self._rows("SELECT DISTINCT series FROM measurements")]

    def table(self, series: str) -> pandas.DataFrame:
        """A series as a DataFrame, a row an item. Raises KeyError where there is none."""
        import pandas

        rows = self._rows("SELECT item, key, value FROM measurements WHERE series = ?", series)
        if not rows:
            raise KeyError(f"{self._file} has no series '{series}': there are "
                           + ", ".join(self.series))
        long = pandas.DataFrame(rows, columns=["item", "key", "value"])
        wide = long.pivot(index="item", columns="key", values="value")
        wide.columns.name = None
        return wide.infer_objects()

    def array(self, series: str, item: int, key: str) -> NDArray[np.float32]:
        """An array of a series, e.g. ("depth", 0, "depth_m"): rows x columns, float32."""
        rows = self._rows("SELECT rows, columns, float32 FROM arrays "
                          "WHERE series = ? AND item = ? AND key = ?", series, item, key)
        if not rows:
            raise KeyError(f"{self._file} has no array {(series, item, key)}")
        height, width, data = rows[0]
        return np.frombuffer(data, "<f4").reshape(height, width)

    def trajectory(self, plan: int = 0) -> Trajectory:
        """Of a plan by its number; its joints are in the order of `table("joint")`."""
        table = self.table(f"trajectory/{plan}")
        joints = self.table("joint")["name"]
        return Trajectory(table["time_s"].to_numpy(float),
                          table[[f"q.{name}" for name in joints]].to_numpy(float),
                          table[[f"qdot.{name}" for name in joints]].to_numpy(float))


def compared(runs: Sequence[Run]) -> pandas.DataFrame:
    """The numbers of several runs' summaries: a DataFrame, a row a run, a column a number, which is
    named by its way in summary.json, e.g. "map.frame_ms.p50"."""
    import pandas

    def flat(value: Any, way: str) -> Iterator[tuple[str, Any]]:
        if isinstance(value, dict):
            for key, item in value.items():
                yield from flat(item, f"{way}.{key}" if way else key)
        elif isinstance(value, list):
            for i, item in enumerate(value):
                yield from flat(item, f"{way}[{i}]")
        elif isinstance(value, (bool, int, float)):
            yield way, value

    return pandas.DataFrame([dict(flat(run.summary, "")) for run in runs],
                            index=[run.folder.name for run in runs])


def plot(runs: Sequence[Run], series: str, key: str,
         file: Union[str, PathLike[str], None] = None) -> Figure:
    """Of each run the share of items at which a column of a series is at most so large, in one
    picture: a Matplotlib figure, also written into `file` (.png, .svg, ...) where that is given."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot(xlabel=key, ylabel="share of items", ylim=(0, 1))
    for run in runs:
        values = np.sort(run.table(series)[key].to_numpy(float))
        values = values[np.isfinite(values)]
        axes.step(values, np.arange(1, len(values) + 1) / len(values), where="post",
                  label=run.folder.name)
    axes.grid(alpha=0.3)
    axes.legend()
    if file is not None:
        figure.savefig(file, dpi=150)
    return figure
