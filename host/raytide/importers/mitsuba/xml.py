"""XML to elements that know their file and line. No DTD, no entity, no external reference gets through."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from raytide.errors import Problem, SceneError
from raytide.importers.files import read_bounded

if TYPE_CHECKING:
    from xml.sax.handler import ContentHandler

MOST_BYTES = 64 << 20  # of one XML file
MOST_ELEMENTS = 2_000_000
DEEPEST = 64  # nested elements; scenes need about ten


@dataclass(eq=False)
class Element:
    """One element of a file."""

    tag: str
    attributes: dict[str, str]
    file: str
    line: int
    children: list[Element] = field(default_factory=list)


def read_elements(path: Path, shown: str) -> Element:
    """The root element of an XML file; `shown` is what messages call the file.

    Raises SceneError with the line: unreadable, not well-formed, a DTD or entities, too deep or too large.
    """
    data = read_bounded(path, MOST_BYTES, "a Mitsuba scene (.xml)")
    return parse_elements(data, shown)


def parse_elements(data: bytes, shown: str) -> Element:
    """The root element of the bytes of an XML file. Raises SceneError with the line."""
    from xml.sax import SAXParseException

    from defusedxml import DefusedXmlException
    from defusedxml.expatreader import DefusedExpatParser

    parser = DefusedExpatParser(forbid_dtd=True, forbid_entities=True, forbid_external=True)
    handler = _handler(parser, shown)
    try:
        parser.parse(io.BytesIO(data))
    except DefusedXmlException as error:
        came = f"a document type or entity ({type(error).__name__})"
        raise _refused(came, "XML without <!DOCTYPE> and entities", shown, handler.line()) from None
    except SAXParseException as error:
        came = f"text that is not well-formed XML ({error.getMessage()})"
        raise _refused(came, "a Mitsuba scene", shown, error.getLineNumber()) from None
    except (ValueError, LookupError, UnicodeError) as error:  # an encoding that Python does not know, for example
        came = f"text that is not XML ({type(error).__name__}: {str(error)[:80]})"
        raise _refused(came, "a Mitsuba scene", shown, None) from None
    if handler.root is None:
        raise _refused("no element", "a Mitsuba scene", shown, None)
    return handler.root


def _refused(came: str, wanted: str, shown: str, line: int | None) -> SceneError:
    return SceneError([Problem("", came, wanted, file=shown, line=line)])


def _handler(parser: Any, shown: str) -> Any:
    """A handler that collects elements; made here so that the XML packages load only when a file is read."""
    from xml.sax.handler import ContentHandler

    class Collector(ContentHandler):
        def __init__(self) -> None:
            super().__init__()
            self.root: Element | None = None
            self.open: list[Element] = []
            self.count = 0

        def line(self) -> int | None:
            return parser.getLineNumber()

        def startElement(self, name: str, attrs: Any) -> None:
            self.count += 1
            line = self.line() or 1
            if self.count > MOST_ELEMENTS or len(self.open) >= DEEPEST:
                came = f"more than {MOST_ELEMENTS:,} elements" if self.count > MOST_ELEMENTS else "deeper elements"
                raise _refused(came, f"at most {MOST_ELEMENTS:,} elements, {DEEPEST} deep", shown, line)
            element = Element(name, dict(attrs), shown, line)
            if self.open:
                self.open[-1].children.append(element)
            else:
                self.root = element
            self.open.append(element)

        def characters(self, content: str) -> None:
            if content.strip() and self.open:
                came = f"the text {content.strip()[:40]!r} between elements"
                raise _refused(came, "values in attributes", shown, self.line())

        def endElement(self, name: str) -> None:
            self.open.pop()

    collector: ContentHandler = Collector()
    parser.setContentHandler(collector)
    return collector
