"""Triangle meshes: read from files, and intersected with rays.

Embree finds the triangle in float32; the intersection with that triangle's plane is then computed
in float64. The remaining error of float32: within some 1e-7 of the mesh's size of an edge, the
neighbouring triangle may be taken.
"""

import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from vrscan.data.arrays import Floats, Ints
from vrscan.data.errors import InputError, InputWarning, beside, one_line
from vrscan.data.extras import interrupt_held
from vrscan.scene.shapes import START, dot, slab

with interrupt_held():
    import trimesh

SUFFIXES = (".stl", ".obj", ".ply")
_CLEAR = 2e-6  # share of the mesh's size: a nearer hit is the surface where the ray starts
_OUTSIDE = 1e-3  # share of a triangle: a hit farther beyond its edge is drawn back to it
_ATTEMPTS = 8  # attempts to get past surfaces that are too near
_FLAT = 1e-300
_SMALLEST_MM, _SMALL_MM = 0.5, 10.0

# Distance and normal on the smooth surface behind the mesh, for rays that hit a triangle:
# (origin [m, 3], direction [m, 3], distance [m], triangle [m]) -> (distance [m], normal [m, 3]).
Refine = Callable[[Floats, Floats, Floats, Ints], tuple[Floats, Floats]]


class Caster:
    """A triangle mesh as a ``Shape``.

    A ray that starts on the mesh meets it again from 2e-6 of its size on, 1e-6 mm at least.
    """

    def __init__(self, vertices: Floats, faces: Ints, refine: Refine | None = None):
        """Prepare the search.

        Args:
            vertices: Vertices, mm, [v, 3].
            faces: Faces, each three rows of ``vertices`` [f, 3].
            refine: Moves hits to the smooth surface that the mesh stands for, if there is one.
        """
        self.vertices, self.faces, self._refine = vertices, faces, refine
        self._extent = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
        size = float(np.linalg.norm(self._extent[1] - self._extent[0]))
        self._clear = START + _CLEAR * size
        self._middle = self._extent.mean(axis=0)
        self._margin = 1e-5 * size

        corner = vertices[faces[:, 0]]
        one, two = vertices[faces[:, 1]] - corner, vertices[faces[:, 2]] - corner
        normal = np.cross(one, two)
        square = np.maximum(dot(normal, normal), _FLAT)[:, None]
        self._corner, self._one, self._two = corner, one, two
        self._normal = normal / np.sqrt(square)
        # Shares of both edges at a point p of the plane: (p - corner) times these.
        self._dual_one = np.cross(two, normal) / square
        self._dual_two = np.cross(normal, one) / square

        self._scene = EmbreeScene()
        centred = (vertices - self._middle).astype(np.float32)
        TriangleMesh(self._scene, centred, faces.astype(np.int32))

    def __reduce__(self) -> tuple[object, ...]:
        return type(self), (self.vertices, self.faces, self._refine)

    @property
    def extent(self) -> Floats:
        """See ``shapes.Shape``."""
        return self._extent

    def meet(self, origin: Floats, direction: Floats) -> tuple[Floats, Floats]:
        """See ``shapes.Shape``."""
        distance = np.full(len(origin), np.inf)
        normal = np.tile([0.0, 0.0, 1.0], (len(origin), 1))
        padded = self._extent + np.array([[-self._margin], [self._margin]])
        enter, leave = slab(padded, origin, direction)
        # Starting at the box, not far before it, keeps float32's steps small, and a little way off
        # a surface where the ray starts on it.
        begin = np.maximum(enter, 0.5 * self._clear)
        rows = np.flatnonzero(begin <= leave)
        for _ in range(_ATTEMPTS):
            if rows.size == 0:
                break
            start, toward = origin[rows], direction[rows]
            local = start + begin[rows, None] * toward - self._middle
            face = self._scene.run(local.astype(np.float32), toward.astype(np.float32))
            hit = face >= 0
            rows, face = rows[hit], face[hit].astype(np.int64)
            found, facing = self._exact(start[hit], toward[hit], face)
            if self._refine is not None:
                found, facing = self._refine(start[hit], toward[hit], found, face)
            ahead = (found > self._clear) & (found > begin[rows] - self._margin)
            distance[rows[ahead]], normal[rows[ahead]] = found[ahead], facing[ahead]
            rows, found = rows[~ahead], found[~ahead]
            begin[rows] = np.maximum(begin[rows], found) + self._clear
        return distance, normal

    def _exact(self, origin: Floats, direction: Floats, face: Ints) -> tuple[Floats, Floats]:
        """Return distance [m] and normal [m, 3] of rays that hit these triangles."""
        corner, normal = self._corner[face], self._normal[face]
        gap = corner - origin
        toward = dot(direction, normal)
        edge_on = np.abs(toward) < 1e-12
        distance = np.where(edge_on, 0.0, dot(gap, normal) / np.where(edge_on, 1.0, toward))
        point = distance[:, None] * direction - gap
        u, v = dot(point, self._dual_one[face]), dot(point, self._dual_two[face])
        outside = edge_on | (np.minimum(np.minimum(u, v), 1.0 - u - v) < -_OUTSIDE)
        if outside.any():
            u, v = np.clip(u[outside], 0.0, 1.0), np.clip(v[outside], 0.0, 1.0)
            total = np.maximum(u + v, 1.0)
            inside = gap[outside] + (u / total)[:, None] * self._one[face[outside]]
            inside += (v / total)[:, None] * self._two[face[outside]]
            distance[outside] = dot(inside, direction[outside])
        return distance, normal


def load_mesh(path: Path, scale: float = 1.0) -> tuple[Floats, Ints]:
    """Return a closed mesh from an STL, OBJ or PLY file.

    Args:
        path: The mesh's file.
        scale: Millimetres per unit of the file.

    Returns:
        Vertices, mm [v, 3], and faces [f, 3].

    Raises:
        InputError: naming the file, if it is missing, of another kind, cannot be read, has no
            face, is not finite, is open (an edge then belongs to an odd number of faces), or is
            smaller than the laser's spot.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"{path}: a mesh is an STL, OBJ or PLY file")
    if not path.is_file():
        raise InputError(f"{path}: no such mesh{beside(path, *SUFFIXES)}")
    try:
        mesh = trimesh.load_mesh(path, process=False, skip_materials=True)
        vertices = np.asarray(mesh.vertices, np.float64).reshape(-1, 3)
        faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    except Exception as error:  # a reader may raise any error for a broken file
        raise InputError(f"{path}: not a mesh that can be read ({one_line(error)})") from error
    if len(faces) == 0:
        raise InputError(f"{path}: the mesh has no face")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path}: a face names a vertex that is not there")
    if not np.isfinite(vertices[faces]).all():
        raise InputError(f"{path}: a vertex is not finite")
    vertices, faces, _ = welded(vertices, faces)
    if len(faces) == 0:
        raise InputError(f"{path}: all faces are degenerate")
    if len(faces) < 4:
        raise InputError(f"{path}: {len(faces)} faces enclose nothing")
    single = open_edges(faces)
    if single:
        raise InputError(f"{path}: the mesh is open at {single} edges; it must be closed")
    _check_size(path, scale * float(np.ptp(vertices, axis=0).max()), scale)
    return vertices * scale, faces


def _check_size(path: Path, size_mm: float, scale: float) -> None:
    """Refuse a mesh smaller than the laser's spot, and tell of one that is hardly larger."""
    hint = f"{path}: the mesh is {size_mm:.3g} mm large with scale = {scale:g}"
    hint += f", {1000 * scale:g} if its unit is the metre"
    if size_mm < _SMALLEST_MM:
        raise InputError(f"{hint}; the laser's spot is larger")
    if size_mm < _SMALL_MM:
        warnings.warn(hint, InputWarning, stacklevel=3)


def welded(vertices: Floats, faces: Ints) -> tuple[Floats, Ints, Ints]:
    """Return a mesh with equal vertices merged, without the faces that this makes degenerate.

    An STL file repeats the vertices of every face; so do edges of texture or normals in OBJ and
    PLY.

    Args:
        vertices: Vertices [v, 3].
        faces: Faces [f, 3].

    Returns:
        Vertices [w, 3], faces [g, 3], and the index of the old face for each new one [g].
    """
    used, faces = np.unique(faces, return_inverse=True)
    # Equal up to 1e-9 of the size, so that two roundings of one corner are the same.
    size = float(np.ptp(vertices[used], axis=0).max()) or 1.0
    grid = np.round(vertices[used] / (1e-9 * size)).astype(np.int64)
    _, first, inverse = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    faces = inverse.reshape(-1)[faces.reshape(-1, 3)]
    a, b, c = faces.T
    kept = np.flatnonzero((a != b) & (b != c) & (c != a))
    return vertices[used][first], faces[kept], kept


def open_edges(faces: Ints) -> int:
    """Return the number of edges that belong to an odd number of faces: 0 for a closed mesh.

    Args:
        faces: Faces [f, 3], with equal vertices merged.
    """
    edge = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    key = edge[:, 0] * (int(faces.max()) + 1) + edge[:, 1]
    _, count = np.unique(key, return_counts=True)
    return int((count % 2 == 1).sum())
