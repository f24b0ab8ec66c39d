"""Exports: everything that was recorded, as tidy tables that describe themselves and can be checked row by row."""

from app.services.export.errors import ExportDifferenceError, ExportError
from app.services.export.materials import ClipBuilder
from app.services.export.options import ExportOptions, People, Samples
from app.services.export.reading import Export, open_export
from app.services.export.writing import export

__all__ = [
    "ClipBuilder",
    "Export",
    "ExportDifferenceError",
    "ExportError",
    "ExportOptions",
    "People",
    "Samples",
    "export",
    "open_export",
]
