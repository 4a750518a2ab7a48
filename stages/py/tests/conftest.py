"""What the tests work on: the demo cell with few beams, scanned and run once a session."""

import dataclasses
import pathlib
import shutil

import pytest

import stillpoint
from stillpoint import _stillpoint

#: Beams of each of the four scanners: a cell of seconds in which all robots are found.
BEAMS = 300_000


@dataclasses.dataclass(frozen=True)
class Demo:
    """The demo's folder."""

    folder: pathlib.Path

    @property
    def scans(self) -> pathlib.Path:
        return self.folder / "demo/scans/scans.e57"

    @property
    def las(self) -> pathlib.Path:
        return self.folder / "demo/scans/scans.las"

    @property
    def scanners(self) -> pathlib.Path:
        return self.folder / "demo/scans/scanners.toml"

    @property
    def robots(self) -> pathlib.Path:
        return self.folder / "demo/robots"

    @property
    def models(self) -> list[pathlib.Path]:
        return sorted(path for path in self.robots.iterdir() if path.is_dir())

    #: The model of the library `one`.
    model = "demo_palletiser_2000"

    @property
    def one(self) -> pathlib.Path:
        """A library of one model, for tests that want a short run."""
        return self.folder / "one"

    @property
    def out(self) -> pathlib.Path:
        return self.folder / "demo/result"

    @property
    def result(self) -> stillpoint.Result:
        return stillpoint.Result(self.out)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Demo:
    folder = tmp_path_factory.mktemp("demo")
    code, *_ = _stillpoint.call(["demo", f"--beams={BEAMS}", f"--out={folder / 'demo'}"])
    assert code == 0
    demo = Demo(folder)
    shutil.copytree(demo.robots / demo.model, demo.one / demo.model)
    return demo
