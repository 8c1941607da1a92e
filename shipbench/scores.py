"""Scores of a study in a notebook: a table, plots and the page."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bench.submissions import Results
from .errors import InputError, unknown_name
from .leaderboard.fit_notes import fit_notes
from .leaderboard.lead import lead
from .leaderboard.pages import scores_of
from .leaderboard.tables import TABLE_III
from .names import brief, shown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from .leaderboard.scores import Scores as BoardScores


class Scores:
    """Scores of models on the held-out runs of one or several data sets, best model first.

    Args:
        results: what `read_results` returned.

    Raises:
        InputError: the rows are of different protocols, data or tasks, which are never ranked together.
    """

    def __init__(self, results: Results) -> None:
        self.results = results
        self._boards: dict[str, BoardScores] = {
            name: scores_of(results, name) for name in dict.fromkeys(s["dataset"] for s in results.summaries)
        }

    @property
    def datasets(self) -> list[str]:
        """Names of the data sets."""
        return list(self._boards)

    @property
    def failed(self) -> list[str]:
        """Fits that failed, each with its reason."""
        return [
            f"{s['dataset']} {s['model']} fold {s['fold']} seed {s['seed']}: {s['reason']}"
            for s in self.results.summaries
            if s["status"] == "failed"
        ]

    @property
    def notes(self) -> list[str]:
        """Warnings on the fits: physics that does not fit its own training runs."""
        return [f"{dataset}, {model}: {note}" for (dataset, model), note in fit_notes(self.results.summaries).items()]

    def table(self, metrics: Sequence[str] = TABLE_III) -> pd.DataFrame:
        """A row for each model, best first: scored of expected predictions, and the mean of each metric with its 95 %
        interval (bootstrap over runs).

        Args:
            metrics: columns of `results.rows`, such as "ed", "final_displacement" or "rmse_r", or their labels, such as
                "ED"; those by default that the study has.

        Returns:
            Columns dataset (of several), model, scored, then `ED`, `ED low`, `ED high` and so on; their units are in
            `attrs["units"]`.

        Raises:
            InputError: the study has no such metric.
        """
        import pandas as pd

        wanted = [metrics] if isinstance(metrics, str) else list(metrics)
        lines, units = [], dict[str, str]()
        for dataset, board in self._boards.items():
            by_label = {column["label"]: name for name, column in board.columns.items()}
            chosen = [
                name
                for name in (by_label.get(name, name) for name in wanted)
                if name in board.columns or metrics is not TABLE_III
            ]
            if unknown := [name for name in chosen if name not in board.columns]:
                raise unknown_name("metric", unknown[0], board.columns)
            figures = {name: board.figures(name) for name in chosen}
            units |= {board.columns[name]["label"]: board.columns[name]["unit"] for name in chosen}
            for model in board.models:
                scored, expected = board.shares[model]
                line: dict[str, Any] = {"dataset": dataset} if len(self._boards) > 1 else {}
                line |= {"model": model, "scored": f"{scored}/{expected}"}
                for name in chosen:
                    label = board.columns[name]["label"]
                    line |= {
                        f"{label}{end.replace('_', ' ')}": figures[name][model][f"{name}_mean{end}"]
                        for end in ("", "_low", "_high")
                    }
                lines.append(line)
        table = pd.DataFrame(lines)
        table.attrs["units"] = units
        return table

    def plot_tracks(self, runs: str | Sequence[str] = (), dataset: str | None = None) -> Figure:
        """Measured and predicted tracks of some runs; by default of a good, a median and a bad one.

        Args:
            runs: one or several names; of a run that is scored in several windows the first window is drawn.
            dataset: name of the data set, where there are several.

        Raises:
            InputError: an unknown run or data set, or no predictions are saved.
        """
        from .leaderboard.plots import tracks

        name, models, summary = self._drawn(dataset)
        rows = self._boards[name].rows
        windows = []
        for run in [runs] if isinstance(runs, str) else runs:
            own = rows.loc[(rows["run"] == run) | (rows["parent"] == run), "run"]
            if own.empty:
                raise unknown_name("run", run, dict.fromkeys(rows["parent"]))
            windows.append(str(own.iloc[0]))
        return _shown_in_notebooks(tracks(self.results, name, models, summary, windows))

    def plot_errors(self, dataset: str | None = None) -> Figure:
        """Box plots of the errors of each run: quartiles, whiskers at 5 and 95 %, mean as a diamond.

        Raises:
            InputError: an unknown data set, or no predictions are saved.
        """
        from .leaderboard.plots import boxes

        name, models, summary = self._drawn(dataset)
        return _shown_in_notebooks(boxes(self._boards[name].rows, models, summary))

    def plot_growth(self, dataset: str | None = None) -> Figure:
        """Position error against the time since the start of the prediction: median and quartiles over runs.

        Raises:
            InputError: an unknown data set, or no predictions are saved.
        """
        from .leaderboard.plots import against_horizon

        name, models, summary = self._drawn(dataset)
        return _shown_in_notebooks(against_horizon(self.results, name, models, summary["dt"]))

    def report(self, path: str | os.PathLike[str], *, diagnosis: Sequence[Path] = ()) -> Path:
        """Write the page of these scores, one HTML file that needs no network, and return its path; `diagnosis`:
        folders of diagnoses to link.

        Raises:
            InputError: the file cannot be written, or a folder holds no diagnosis of these data.
        """
        from .reports.study.page import write_report

        return write_report(self.results, Path(path), "shipbench.report(...) in Python", given=list(diagnosis)).path

    def _drawn(self, dataset: str | None) -> tuple[str, list[str], dict[str, Any]]:
        """Name of a data set, its models that can be drawn, and a summary of its study."""
        from .leaderboard.plots import drawable

        name = dataset if dataset is not None else self.datasets[0]
        if name not in self._boards:
            raise unknown_name("data set", name, self.datasets)
        models, _ = drawable(self.results, name, self._boards[name].models)
        if not models:
            raise InputError(
                f"data set '{name}': no model has saved predictions of a scored run. Give the folder that "
                "`shipbench run` wrote, whole."
            )
        return name, models, next(s for s in self.results.summaries if s["dataset"] == name)

    def _lines(self) -> Iterator[str]:
        for dataset, board in self._boards.items():
            summary = next(s for s in self.results.summaries if s["dataset"] == dataset)
            windows = len(board.rows[["fold", "run"]].drop_duplicates())
            yield (
                f"Scores on {dataset}: {windows} held-out predictions of {summary['task']['horizon_s']:g} s; mean "
                "position error ED (95 % interval)"
            )
            yield lead(board)
            figures = board.figures("ed")
            for model in board.models:
                scored, expected = board.shares[model]
                ed, low, high = (figures[model][f"ed_mean{end}"] for end in ("", "_low", "_high"))
                error = f"{ed:.3g} m ({low:.3g} to {high:.3g} m)" if scored else "no score"
                yield f"  {model}: {error}" + (f", {scored} of {expected} predictions" if scored < expected else "")
        yield from (f"failed: {line}" for line in self.failed)
        yield from (f"note: {line}" for line in self.notes)

    def __repr__(self) -> str:
        return brief("\n".join(self._lines()))

    def _repr_html_(self) -> str:
        table = self.table().to_html(index=False, float_format="{:.3g}".format, na_rep="-", max_rows=60)
        told = [*(f"failed: {line}" for line in self.failed[:10]), *(f"note: {line}" for line in self.notes[:10])]
        units = ", ".join(f"{label} in {unit}" for label, unit in self.table().attrs["units"].items())
        first = "".join(f"<p>{escape(shown(lead(board)))}</p>" for board in self._boards.values())
        return f"{first}{table}<p>{escape(units)}; low and high: 95 % interval</p>" + "".join(
            f"<p>{escape(shown(line))}</p>" for line in told
        )


def _shown_in_notebooks(figure: Figure) -> Figure:
    """Figure that a notebook shows without pyplot, whose global state stays as it is."""

    def png() -> bytes:
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png")
        return buffer.getvalue()

    figure._repr_png_ = png  # type: ignore[attr-defined]
    return figure
