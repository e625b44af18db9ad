"""The checks of a flight as a JUnit file, as the benches of Jenkins and GitLab read it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from xml.etree import ElementTree

from brickpilot.vehicle.flight_checks import Check


def text(name: str, checks: Sequence[Check], command: str) -> str:
    """Returns the file: a test suite `name` with a test case for each check.

    Args:
        command: the command line that repeats the flight; a property of the suite.
    """
    cases = [_case(name, check) for check in checks]
    failures = sum(check.failure is not None for check in checks)
    return _file(name, cases, failures=failures, errors=0, command=command)


def text_of_error(name: str, message: str, command: str) -> str:
    """Returns the file of a flight that did not begin: one test case, the link, with the error."""
    case = _case(name, Check("link", None))
    ElementTree.SubElement(case, "error", message=message, type="no flight").text = message
    return _file(name, [case], failures=0, errors=1, command=command)


def _case(suite: str, check: Check) -> ElementTree.Element:
    case = ElementTree.Element("testcase", name=check.name, classname=suite, time=f"{check.seconds:.3f}")
    if check.failure is not None:
        ElementTree.SubElement(case, "failure", message=check.failure, type="mission").text = check.failure
    if check.detail:
        ElementTree.SubElement(case, "system-out").text = check.detail
    return case


def _file(name: str, cases: Sequence[ElementTree.Element], *, failures: int, errors: int, command: str) -> str:
    counts = {"tests": str(len(cases)), "failures": str(failures), "errors": str(errors)}
    counts["time"] = f"{sum(float(case.attrib['time']) for case in cases):.3f}"
    root = ElementTree.Element("testsuites", counts)
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")
    suite = ElementTree.SubElement(root, "testsuite", counts, name=name, skipped="0", timestamp=now)
    properties = ElementTree.SubElement(suite, "properties")
    ElementTree.SubElement(properties, "property", name="command", value=command)
    suite.extend(cases)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
