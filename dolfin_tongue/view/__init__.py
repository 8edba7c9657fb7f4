"""Pictures of bodies, states and records. Importing this needs no display and no VTK.

In all pictures the tip of the tongue is to the LEFT and up is upwards, as in midsagittal views of
speech science; see `dolfin_tongue.view.camera`.
"""

from dolfin_tongue.view.animation import animation
from dolfin_tongue.view.camera import ABOVE, OBLIQUE, SIDE, View
from dolfin_tongue.view.contact import contact_picture
from dolfin_tongue.view.fibres import fibre_pictures
from dolfin_tongue.view.picture import shape_picture
from dolfin_tongue.view.plots import contact_plot, energy_plot, rigid_plot, trajectories
from dolfin_tongue.view.sheet import contact_sheet, final_shapes, key_frames
from dolfin_tongue.view.surroundings import Surroundings

__all__ = [
    "ABOVE",
    "OBLIQUE",
    "SIDE",
    "Surroundings",
    "View",
    "animation",
    "contact_picture",
    "contact_plot",
    "contact_sheet",
    "energy_plot",
    "fibre_pictures",
    "final_shapes",
    "key_frames",
    "rigid_plot",
    "shape_picture",
    "trajectories",
]
