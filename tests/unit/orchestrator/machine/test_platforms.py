"""The platforms of both versions of FMI, by their names in the standards."""

from __future__ import annotations

import platform

import pytest

from orchestrator.machine.platforms import platforms, this_machine

#: Names of folders in `binaries`: FMI 2.0.4, section 2.3, which has names for x86 and for all else
#: those of FMI 3.0.1, section 2.5.1.4.1.
FOLDERS = {
    "2": {
        "linux64": ".so",
        "win64": ".dll",
        "darwin64": ".dylib",
        "aarch64-linux": ".so",
        "aarch64-darwin": ".dylib",
    },
    "3": {
        "x86_64-linux": ".so",
        "aarch64-linux": ".so",
        "x86_64-windows": ".dll",
        "x86_64-darwin": ".dylib",
        "aarch64-darwin": ".dylib",
    },
}

#: What Python says of a machine, and what the versions of FMI call it.
MACHINES = {
    ("x86_64", "Linux"): (["linux64"], ["x86_64-linux"]),
    ("aarch64", "Linux"): (["aarch64-linux"], ["aarch64-linux"]),
    ("AMD64", "Windows"): (["win64"], ["x86_64-windows"]),
    ("x86_64", "Darwin"): (["darwin64"], ["x86_64-darwin"]),
    # Some hosts look into one, some into the other.
    ("arm64", "Darwin"): (["darwin64", "aarch64-darwin"], ["aarch64-darwin"]),
    ("riscv64", "Linux"): ([], []),
}


@pytest.mark.parametrize("fmi", FOLDERS)
def test_all_platforms_are_those_of_the_standard(fmi: str):
    assert {found.name: found.ending for found in platforms(fmi, "all")} == FOLDERS[fmi]


@pytest.mark.parametrize("machine", MACHINES, ids=" ".join)
@pytest.mark.parametrize("fmi", FOLDERS)
def test_without_names_it_is_this_machine(fmi, machine, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(platform, "machine", lambda: machine[0])
    monkeypatch.setattr(platform, "system", lambda: machine[1])
    names = MACHINES[machine][list(FOLDERS).index(fmi)]
    if names:
        assert [found.name for found in platforms(fmi)] == names
        assert all(this_machine() in found.machines for found in platforms(fmi))
    else:
        with pytest.raises(ValueError, match=f"no platform for this machine, {machine[0]}-"):
            platforms(fmi)


def test_names_may_come_in_any_order_and_twice():
    wanted = platforms("2", "win64, linux64,win64")
    assert [found.name for found in wanted] == ["linux64", "win64"]


def test_library_of_macos_is_for_both_of_its_processors():
    [darwin] = platforms("2", "darwin64")
    assert darwin.machines == ("x86_64-darwin", "aarch64-darwin")


@pytest.mark.parametrize(
    ("fmi", "names", "complaint"),
    [
        (
            "2",
            "win32",
            "FMI 2.0 has no platform 'win32'; there are linux64, win64, darwin64, aarch64-linux, "
            "aarch64-darwin, or all$",
        ),
        ("2", "linux64,", "no platform ''"),
        ("2", "all,linux64", "no platform 'all'"),
        ("2", "x86_64-linux", "no platform 'x86_64-linux'.*; try --fmi 3$"),
        ("3", "linux64", "FMI 3.0 has no platform 'linux64'.*; try --fmi 2$"),
    ],
)
def test_unknown_platform_is_named(fmi: str, names: str, complaint: str):
    with pytest.raises(ValueError, match=complaint):
        platforms(fmi, names)
