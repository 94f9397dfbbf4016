"""The digest of code changes with every file of it, and an identity names what differs."""

from __future__ import annotations

from orchestrator.machine import identity


def test_the_digest_of_code_has_every_file_and_its_place(tmp_path, monkeypatch):
    package = tmp_path / "some_package"
    (package / "inner").mkdir(parents=True)
    for name in ("__init__.py", "inner/one.py", "inner/two.c", "inner/notes.txt"):
        (package / name).write_text("")
    monkeypatch.syspath_prepend(tmp_path)

    def digest() -> str:
        identity.code_of.cache_clear()
        return identity.code_of("some_package")

    found = [digest()]
    (package / "inner/two.c").write_text("/* */")
    found.append(digest())
    (package / "inner/one.py").rename(package / "one.py")
    found.append(digest())
    (package / "inner/notes.txt").write_text("none of the code")
    assert len({*found}) == 3 and digest() == found[-1]


def test_what_differs_is_named_in_order():
    first, second = {"a": "1", "b": "2", "c": "3"}, {"b": "2", "c": "4", "d": "1"}
    assert identity.differences(first, second) == ["a", "c", "d"]
    assert identity.digest_of(first, second) != identity.digest_of(second, first)
