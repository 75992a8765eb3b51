"""Distance and normal of triangle meshes and terrain in Warp.

The steps are those of ``native/sdf/mesh_shape.cpp`` and of :mod:`surfsup.sdf.heightfield`: triangles near the surface,
grids far from it.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from surfsup.warp_runtime import Precision

# A bound of the distance is widened by this part and by this part of the mesh's extent, since Warp's hierarchy computes
# in single precision.
WIDER = 1.00001
ROUNDING = 1e-6
WINDING_ACCURACY = 2.0  # Warp's own, and libigl's
AT_CORNER, AT_EDGE = 1 - 1e-4, 1e-4  # barycentric coordinates, as in surfsup.sdf.mesh.query


@cache
def mesh_kernels(precision: Precision) -> SimpleNamespace:
    """The kernels in a precision, and the structs ``Triangles`` and ``Grid``.

    All points but those of the caller are relative to the middle of the mesh.
    """
    real, vec3 = precision.real, precision.vec3
    module = f"surfsup.mesh.{precision.name}"
    zero, half, one, nowhere = real(0.0), real(0.5), real(1.0), real(wp.nan)
    at_corner, at_edge, tiny = real(AT_CORNER), real(AT_EDGE), real(1e-30)
    wider, winding_accuracy = wp.constant(WIDER), wp.constant(WINDING_ACCURACY)

    @wp.struct
    class Triangles:
        mesh: wp.uint64
        center: vec3
        rounding: float
        on_surface: real
        corners: wp.array2d(dtype=vec3)
        normals: wp.array2d(dtype=vec3)

    @wp.struct
    class Grid:
        lower: vec3
        upper: vec3
        center: vec3
        cell: real
        nodes: wp.vec3i
        table: wp.array(dtype=wp.vec4f)

    @wp.struct
    class Nearest:
        distance: real
        face: int
        point: vec3

    @wp.func
    def single(vector: vec3) -> wp.vec3f:
        return wp.vec3f(wp.float32(vector[0]), wp.float32(vector[1]), wp.float32(vector[2]))

    @wp.func
    def closest_on(a: vec3, b: vec3, c: vec3, point: vec3) -> vec3:
        """The point on a triangle closest to a point (C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5)."""
        ab, ac, ap = b - a, c - a, point - a
        d1, d2 = wp.dot(ab, ap), wp.dot(ac, ap)
        if d1 <= zero and d2 <= zero:
            return a
        bp = point - b
        d3, d4 = wp.dot(ab, bp), wp.dot(ac, bp)
        if d3 >= zero and d4 <= d3:
            return b
        vc = d1 * d4 - d3 * d2
        if vc <= zero and d1 >= zero and d3 <= zero and d1 > d3:
            return a + d1 / (d1 - d3) * ab
        cp = point - c
        d5, d6 = wp.dot(ab, cp), wp.dot(ac, cp)
        if d6 >= zero and d5 <= d6:
            return c
        vb = d5 * d2 - d1 * d6
        if vb <= zero and d2 >= zero and d6 <= zero and d2 > d6:
            return a + d2 / (d2 - d6) * ac
        va = d3 * d6 - d5 * d4
        if va <= zero and d4 - d3 >= zero and d5 - d6 >= zero and (d4 - d3) + (d5 - d6) > zero:
            return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
        total = va + vb + vc
        if total > zero:
            return a + vb / total * ab + vc / total * ac
        return a

    @wp.func
    def nearest(solid: Triangles, point: vec3, bound: real) -> Nearest:
        """The nearest triangle to a point relative to the center; the face is -1 if none is within the bound."""
        reach = wp.float32(bound) * wider + solid.rounding
        query = wp.mesh_query_point_no_sign(solid.mesh, single(point), reach)
        found = Nearest()
        found.face = -1
        if query.result:
            found.face = query.face
            corners = solid.corners[query.face]
            found.point = closest_on(corners[0], corners[1], corners[2], point)
            found.distance = wp.length(point - found.point)
        return found

    @wp.func
    def surface_normal(solid: Triangles, found: Nearest) -> vec3:
        """The normal at a point on the mesh: that of the face, or the mean around an edge or a corner."""
        corners, normals = solid.corners[found.face], solid.normals[found.face]
        to_b, to_c, to_point = corners[1] - corners[0], corners[2] - corners[0], found.point - corners[0]
        across = wp.cross(to_b, to_c)
        area = wp.max(wp.dot(across, across), tiny)
        at_b = wp.dot(wp.cross(to_point, to_c), across) / area
        at_c = wp.dot(wp.cross(to_b, to_point), across) / area
        weight = vec3(one - at_b - at_c, at_b, at_c)
        largest, smallest = int(0), int(0)
        for corner in range(1, 3):
            if weight[corner] > weight[largest]:
                largest = corner
            if weight[corner] < weight[smallest]:
                smallest = corner
        if weight[largest] > at_corner:
            return normals[1 + largest]
        if weight[smallest] < at_edge:
            return normals[4 + smallest]
        return normals[0]

    @wp.func
    def normal_of(solid: Triangles, point: vec3, found: Nearest, sign: real) -> vec3:
        """The unit gradient of the signed distance."""
        if found.distance < solid.on_surface:
            return surface_normal(solid, found)
        return (point - found.point) * (sign / found.distance)

    @wp.func
    def table_mean(grid: Grid, point: vec3) -> wp.vec4f:
        """The trilinear mean of the table's entries around a point in the grid."""
        place, first = (point - grid.lower) / grid.cell, wp.vec3i()
        for axis in range(3):
            first[axis] = wp.clamp(int(place[axis]), 0, grid.nodes[axis] - 2)
        part = wp.vec3f(
            wp.float32(place[0] - real(first[0])),
            wp.float32(place[1] - real(first[1])),
            wp.float32(place[2] - real(first[2])),
        )
        mean = wp.vec4f()
        for corner in range(8):
            weight, index = wp.float32(1.0), int(0)
            for axis in range(3):
                step = (corner >> (2 - axis)) & 1
                if step == 1:
                    weight *= part[axis]
                else:
                    weight *= wp.float32(1.0) - part[axis]
                index = index * grid.nodes[axis] + first[axis] + step
            mean += weight * grid.table[index]
        return mean

    @wp.func
    def contains(grid: Grid, point: vec3) -> bool:
        return wp.max(wp.min(point, grid.upper), grid.lower) == point

    @wp.func
    def gradient_of(mean: wp.vec4f) -> vec3:
        return vec3(real(mean[1]), real(mean[2]), real(mean[3]))

    @wp.func
    def distance_of(grid: Grid, mean: wp.vec4f, point: vec3) -> real:
        return real(mean[0]) + half * wp.dot(point - grid.center, gradient_of(mean))

    @wp.func
    def beyond_fine(coarse: Grid, point: vec3) -> vec3:
        """From the nearest surface point to a point outside the bounding box of the mesh."""
        border = wp.max(wp.min(point, coarse.upper), coarse.lower)
        mean = table_mean(coarse, border)
        return point - border + distance_of(coarse, mean, border) * wp.normalize(gradient_of(mean))

    @wp.func
    def nearest_node(grid: Grid, point: vec3) -> int:
        index = int(0)
        for axis in range(3):
            node = int(wp.rint((point[axis] - grid.lower[axis]) / grid.cell))
            index = index * grid.nodes[axis] + wp.clamp(node, 0, grid.nodes[axis] - 1)
        return index

    @wp.func
    def distance_to_node(grid: Grid, point: vec3) -> real:
        place = (point - grid.lower) / grid.cell
        for axis in range(3):
            place[axis] = place[axis] - wp.rint(place[axis])
        return wp.length(place) * grid.cell

    @wp.kernel(module=module, enable_backward=False)
    def query_mesh(
        points: wp.array(dtype=vec3),
        solid: Triangles,
        fine: Grid,
        coarse: Grid,
        node_distance: wp.array(dtype=real),
        mesh_range: real,
        min_agreement: real,
        distance: wp.array(dtype=real),
        normal: wp.array(dtype=vec3),
    ):
        """Distance and normal by the grids, and by the triangles near the surface or where the grid disagrees."""
        i = wp.tid()
        point = points[i] - solid.center
        distance[i] = nowhere
        normal[i] = vec3(nowhere, nowhere, nowhere)
        if not wp.isfinite(point):
            return
        if not contains(fine, point):
            away = beyond_fine(coarse, point)
            distance[i] = wp.length(away)
            normal[i] = wp.normalize(away)
            return
        mean = table_mean(fine, point)
        by_grid, agreement = distance_of(fine, mean, point), wp.length(gradient_of(mean))
        if wp.abs(by_grid) >= mesh_range and agreement >= min_agreement:
            distance[i] = by_grid
            normal[i] = gradient_of(mean) / agreement
            return
        to_node, of_node = distance_to_node(fine, point), node_distance[nearest_node(fine, point)]
        found = nearest(solid, point, to_node + wp.abs(of_node))
        sign = one
        if to_node >= found.distance:  # the surface may be between the point and the node
            query = wp.mesh_query_point_sign_winding_number(
                solid.mesh, single(point), wp.float32(found.distance) * wider + solid.rounding, winding_accuracy, 0.5
            )
            sign = real(query.sign)
        elif of_node < zero:
            sign = -one
        distance[i] = sign * found.distance
        normal[i] = normal_of(solid, point, found, sign)

    @wp.kernel(module=module, enable_backward=False)
    def query_terrain(
        points: wp.array(dtype=vec3),
        solid: Triangles,
        levels: wp.array2d(dtype=real),
        size: vec3,
        distance: wp.array(dtype=real),
        normal: wp.array(dtype=vec3),
    ):
        """Distance and normal by the triangles; inside is below the terrain, above z = 0 and within its extent."""
        i = wp.tid()
        point = points[i]
        distance[i] = nowhere
        normal[i] = vec3(nowhere, nowhere, nowhere)
        if not wp.isfinite(point):
            return
        cells_east, cells_south = real(levels.shape[1] - 1), real(levels.shape[0] - 1)
        east, south = (point[0] / size[0] + half) * cells_east, (half - point[1] / size[1]) * cells_south
        within = east >= zero and east <= cells_east and south >= zero and south <= cells_south
        column = int(wp.clamp(east, zero, cells_east - one))
        row = int(wp.clamp(south, zero, cells_south - one))
        east = wp.clamp(east, zero, cells_east) - real(column)
        south = wp.clamp(south, zero, cells_south) - real(row)
        north_west, north_east = levels[row, column], levels[row, column + 1]
        south_west, south_east = levels[row + 1, column], levels[row + 1, column + 1]
        level = zero
        if wp.abs(north_west - south_east) <= wp.abs(north_east - south_west):
            if south > east:
                level = north_west + south * (south_west - north_west) + east * (south_east - south_west)
            else:
                level = north_west + east * (north_east - north_west) + south * (south_east - north_east)
        elif east + south < one:
            level = north_west + east * (north_east - north_west) + south * (south_west - north_west)
        else:
            level = south_east + (one - east) * (south_west - south_east) + (one - south) * (north_east - south_east)
        bound, sign = real(wp.inf), one
        if within:
            bound = wp.abs(point[2] - level)
            if point[2] > zero and point[2] < level:
                sign = -one
        own = point - solid.center
        found = nearest(solid, own, bound)
        distance[i] = sign * found.distance
        normal[i] = normal_of(solid, own, found, sign)

    return SimpleNamespace(
        Triangles=Triangles,
        Grid=Grid,
        query_mesh=query_mesh,
        query_terrain=query_terrain,
        kernels=(query_mesh, query_terrain),
    )
