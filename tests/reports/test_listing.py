"""What parts say of themselves, read without importing them; and the facade."""

from __future__ import annotations

import subprocess
import sys

import pytest

import shipbench
from shipbench.reports.listing import read_part


def test_fields_of_the_bound_class_and_its_bases_are_parameters(tmp_path):
    file = tmp_path / "part.py"
    file.write_text(
        '"""One sentence\non it.\n\nMore."""\nimport nothing_of_that_name\n'
        "class Base:\n    first: int = 1\n    name: ClassVar[str] = 'x'\n    _hidden: int = 2\n"
        "class Part(Base):\n    needs: ClassVar[tuple[str, ...]] = ('torch',)\n    second: float\n"
        "    third: list = field(init=False)\n"
        "class Other:\n    wrong: int = 0\n"
        "PREDICTOR = Part\n"
    )
    assert read_part(file, "PREDICTOR") == ("One sentence on it.", {"first": "1", "second": ""}, ("torch",))
    assert read_part(file, "PREDICTOR", "part:Other") == ("One sentence on it.", {"wrong": "0"}, ())


def test_a_part_that_cannot_be_read_is_still_listed(tmp_path):
    (tmp_path / "bad.py").write_text("def broken(:\n")
    assert read_part(tmp_path / "bad.py", "PREDICTOR") == ("(its source cannot be read)", {}, ())


@pytest.mark.parametrize("name", [n for n in shipbench.__all__ if n != "__version__"])
def test_every_name_of_the_facade_is_there(name):
    assert getattr(shipbench, name) is not None
    assert name in dir(shipbench)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        shipbench.nothing  # noqa: B018


def test_importing_shipbench_imports_nothing_else():
    code = (
        "import sys; import shipbench; print([m for m in ('numpy', 'pandas', 'torch', 'pydantic', 'typer') if m "
        "in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
