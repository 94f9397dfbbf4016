"""Files are read by local names; what a careful reader would stumble over is a note."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

from orchestrator.machine.documents import read_document

#: Two namespaces of one standard.
SSD, SSC = "urn:structure", "urn:common"


def read(text: str) -> tuple[ElementTree.Element, list[str]]:
    notes: list[str] = []
    return read_document(text.encode(), notes.append, (SSD, SSC), "SSP"), notes


def test_elements_bear_their_local_names_whatever_the_prefixes():
    texts = (
        f'<a:System xmlns:a="{SSD}" xmlns:b="{SSC}" name="x"><b:Real unit="m"/></a:System>',
        f'<System xmlns="{SSD}" name="x"><Real xmlns="{SSC}" unit="m"/></System>',
    )
    for text in texts:
        root, notes = read(text)
        plain = b'<System name="x"><Real unit="m" /></System>'
        assert (ElementTree.tostring(root), notes) == (plain, [])


def test_prefix_that_is_not_declared_is_a_note():
    root, notes = read(f'<System xmlns="{SSD}"><ssc:Real/></System>')
    assert [child.tag for child in root] == ["Real"]
    assert notes == ["the prefix 'ssc' is not declared"]


def test_declaration_of_a_prefix_ends_with_its_element():
    text = f'<System xmlns="{SSD}"><Real xmlns:b="{SSC}"/><b:Real/></System>'
    assert read(text)[1] == ["the prefix 'b' is not declared"]


def test_foreign_namespace_is_a_note_but_in_annotations():
    text = '<System xmlns="{}"><Annotations><x:Any xmlns:x="urn:x"/></Annotations></System>'
    assert read(text.format(SSD))[1] == []
    assert (
        "elements are in the namespace 'urn:y', which is not SSP's" in read(text.format("urn:y"))[1]
    )


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("<a><b></a>", "not well-formed XML: mismatched tag"),
        ("", "not well-formed XML: no element found"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "it has a DOCTYPE"),
        ("<!DOCTYPE a><a/>", "it has a DOCTYPE"),
    ],
)
def test_malformed_or_expanding_xml_is_refused(text: str, why: str):
    with pytest.raises(ValueError, match=why):
        read(text)
