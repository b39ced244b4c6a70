"""Budgets of the fluid: what has changed its momentum and its energy in the step just made."""

from __future__ import annotations

import numpy as np

from cfddem.fluid.grid import Array
from cfddem.fluid.state import FluidState, on_faces
from cfddem.fluid.work_of_terms import Works, kinetic_energy, works


class FluidBudgets(FluidState):
    """A fluid that accounts for its momentum and energy; nothing here advances it."""

    def drag_exchange(self) -> Array:
        r"""Momentum that drag gave to the fluid over the last step, cell by cell (nz, ny, nx, 3) [N s].

        .. math:: \Delta m = h V\, W\,(\beta v - \beta u_d)

        with the weight W and the velocity u_d of `drag_response`.

        A particle with its own coefficient b [kg/s], of which beta V is the sum, received the impulse
        h W b (u_d - v): summed over the particles of a cell this is the opposite of the momentum of the cell to
        round-off. h is the step just made, V the cell. Half the drag of a cell acts on each of its two faces; where a
        face is a wall or an inlet, that half is taken by what holds the face, and is counted here too.
        """
        fields, (weight, seen) = self.fields, self.drag_response()
        push = np.moveaxis(fields.owned("drag_momentum"), 0, -1) - fields.owned("drag")[..., None] * seen
        moved: Array = self.last_step * self.grid.cell_volume * weight * push
        return moved

    def momentum(self) -> Array:
        """Momentum of the fluid, sum of rho eps u V over all faces with an unknown velocity (3,) [N s]."""
        return self._momentum(self.fields.velocity, self.fields.mean_voidage)

    def momentum_ledger(self) -> dict[str, Array]:
        r"""Sources of the change of momentum in the last step, each (3,) [N s].

        change      of `momentum()`
        drag        sum of `drag_exchange()`
        particles   :math:`h \sum V p\,\nabla\varepsilon`, what model A takes from the fluid and gives to the particles
        source      of the user
        driving     of the mean pressure gradient of periodic sides
        boundaries  the rest: pressure, stress and flow at walls, inlets and outlets; zero in a periodic box
        """
        fields, total = self.fields, self.communicator.sum
        h, volume = self.last_step, self.grid.cell_volume
        before = self._momentum(fields.other_velocity, fields.other_voidage)
        share = self.open_cells if self.model == "B" else self.open_cells * fields.owned("centred_voidage")
        lines = {
            "change": self.momentum() - before,
            "drag": total(self.drag_exchange(), axis=(0, 1, 2)),
            "particles": np.zeros(3) if self.model == "B" else self._pressure_on_particles(),
            "source": h * volume * total(fields.owned("source"), axis=(1, 2, 3)),
            "driving": h * volume * total(share) * self.boundaries.driving,
        }
        lines["boundaries"] = lines["change"] - sum(lines[name] for name in lines if name != "change")
        return lines

    def work(self) -> Works:
        """Energy that each term of the momentum balance has given to the fluid in the last step [J]."""
        return works(self)

    def kinetic_energy(self) -> float:
        """Kinetic energy of the fluid [J]."""
        return kinetic_energy(self)

    def _momentum(self, velocity: Array, voidage: Array) -> Array:
        """Momentum (3,) of a padded velocity with a padded voidage [N s]."""
        grid, total = self.grid, np.zeros(3)
        for d in range(3):
            faces = grid.inner_faces(on_faces(voidage, d) * velocity[d] * self.faces.solved[d], d)
            unique = np.moveaxis(faces, 2 - d, 0)[: self.boundaries.owned_faces(d)]
            total[d] = self.density * grid.cell_volume * self.communicator.sum(unique)
        return total

    def _pressure_on_particles(self) -> Array:
        """Momentum that model A takes from the fluid where the voidage varies, sum of h V p grad(eps) (3,) [N s]."""
        own, solved, given = self.fields.centred_voidage, self.faces.solved, np.zeros(3)
        for d in range(3):
            axis = 2 - d
            low = np.where(solved[d] > 0.0, on_faces(own, d), own)
            high = np.where(np.roll(solved[d], -1, axis) > 0.0, 0.5 * (own + np.roll(own, -1, axis)), own)
            pushed = self.communicator.sum(self.pressure * self.grid.inner(high - low))
            given[d] = self.last_step * self.face_areas[d] * pushed
        return given
