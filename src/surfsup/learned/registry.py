"""All kinds of learned simulator, by the name under which their weights are saved."""

from __future__ import annotations

from surfsup.learned.corrected.simulator import CorrectedSimulator
from surfsup.learned.message_passing.gns import Gns
from surfsup.learned.message_passing.no_sdf import NoSdf
from surfsup.learned.message_passing.surfsup import Surfsup
from surfsup.learned.message_passing.value_only import ValueOnly
from surfsup.sph.simulator import Simulator

KINDS: dict[str, type[Simulator]] = {
    simulator.kind: simulator for simulator in (CorrectedSimulator, Surfsup, ValueOnly, NoSdf, Gns)
}
