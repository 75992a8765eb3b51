"""`surfsup fit`: fit networks that represent surfaces; its verbs by name."""

from __future__ import annotations

import typer

from surfsup.cli.fit_deepsdf import deepsdf
from surfsup.cli.fit_siren import siren
from surfsup.cli.option_groups import expand_option_groups
from surfsup.cli.shape_codes import between, code

fit = typer.Typer(help="Fit networks that represent surfaces: a SIREN to one shape, a DeepSDF to many.")

for verb in (siren, deepsdf, code, between):
    fit.command()(expand_option_groups(verb))
