"""The papers of a run against their schemas, by validators of others (PyPI jsonschema and xmlschema).

    validate.py RUN DOCS     RUN: a run's folder with a passport; DOCS: the folder with the schemas

Whole papers are accepted; one with a key less, a key more or a value of another type is refused, for every key.
JSON and XML say the same.
"""

import copy
import json
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import jsonschema
import xmlschema

NIL = "{http://www.w3.org/2001/XMLSchema-instance}nil"


def same(value, element, place):
    """The element says what the JSON value says."""
    if element.get(NIL) == "true":
        assert value is None, place
    elif isinstance(value, dict):
        assert sorted(value) == sorted(child.tag for child in element), place
        for child in element:
            same(value[child.tag], child, f"{place}/{child.tag}")
    elif isinstance(value, list) and any(isinstance(one, (list, dict)) for one in value):
        assert len(value) == len(element), place
        for index, (one, child) in enumerate(zip(value, element)):
            assert child.tag == ("row" if isinstance(one, list) else "entry"), place
            same(one, child, f"{place}/{index}")
    elif isinstance(value, list):
        assert value == [float(word) for word in element.text.split()], place
    elif isinstance(value, bool):
        assert element.text == str(value).lower(), place
    elif isinstance(value, (int, float)):
        assert value == float(element.text), place
    else:
        assert value == (element.text or ""), place


def keys(value, path=()):
    """Paths to all keys; of a list of objects the first one stands for all."""
    if isinstance(value, dict):
        for key in value:
            yield path + (key,)
            yield from keys(value[key], path + (key,))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from keys(value[0], path + (0,))


def broken_json(whole, path):
    """Without the key; with one more beside it; with a value that nothing is."""
    for way in ("missing", "more", "type"):
        broken = copy.deepcopy(whole)
        holder = broken
        for key in path[:-1]:
            holder = holder[key]
        if way == "missing":
            del holder[path[-1]]
        elif way == "more":
            holder["more"] = 1
        else:
            holder[path[-1]] = [{"no": "thing"}]
        yield way, broken


def broken_xml(text, path):
    """The same for XML, where a text may hold anything but elements."""
    for way in ("missing", "more", "type"):
        root = ElementTree.fromstring(text)
        holder = root
        for key in path[:-1]:
            holder = holder[key] if isinstance(key, int) else holder.find(key)
        element = holder.find(path[-1])
        if way == "missing":
            holder.remove(element)
        elif way == "more":
            ElementTree.SubElement(holder, "more").text = "1"
        else:
            element.attrib.pop(NIL, None)
            for child in list(element):
                element.remove(child)
            ElementTree.SubElement(element, "no").text = "thing"
        yield way, root


# Passports of earlier versions lack these, and stay valid.
NEWER = [("origin", "unproven"), ("origin", "chain")]


def main(run, docs):
    passport = json.loads((run / "passport.json").read_text())
    xml = (run / "passport.xml").read_text()
    read = lambda name: json.loads((docs / name).read_text())
    schema = read("passport.schema.json")
    jsonschema.Draft202012Validator.check_schema(schema)
    by_json = jsonschema.Draft202012Validator(schema)
    by_xml = xmlschema.XMLSchema(docs / "passport.xsd")

    by_json.validate(passport)
    by_xml.validate(xml)
    same(passport, ElementTree.fromstring(xml), "passport")

    refused = 0
    for path in keys(passport):
        for way, broken in broken_json(passport, path):
            if way == "missing" and path in NEWER:
                by_json.validate(broken)
                continue
            assert not by_json.is_valid(broken), f"JSON accepted: {way} at {path}"
            refused += 1
        for way, broken in broken_xml(xml, path):
            if way == "missing" and path in NEWER:
                by_xml.validate(broken)
                continue
            assert not by_xml.is_valid(broken), f"XML accepted: {way} at {path}"
            refused += 1
    print(f"passport.json and passport.xml: valid, the same content; {refused} broken ones refused")

    records = jsonschema.Draft202012Validator(read("run.schema.json"))
    record = json.loads((run / "run.json").read_text())
    records.validate(record)
    for key in read("run.schema.json")["required"]:
        assert not records.is_valid({name: value for name, value in record.items() if name != key}), key
    print(f"run.json: valid, {len(record['items'])} items")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
