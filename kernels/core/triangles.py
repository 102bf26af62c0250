"""The triangle of a mesh that is nearest to each of many points, with Warp's own search tree."""

import warp as wp

__all__ = ["nearest_triangles"]


@wp.kernel(enable_backward=False)
def nearest_triangles(
    mesh: wp.uint64,
    points: wp.array(dtype=wp.vec3),
    farthest: float,
    face: wp.array(dtype=int),
    sign: wp.array(dtype=float),
):
    """Write the number of the nearest triangle, -1 beyond `farthest`, and -1 for points inside the mesh, else 1.

    The mesh is closed. Lengths are in any unit; float32 decides between triangles that are equally far but for rounding, so
    that the place on the triangle is for the caller to find.
    """
    k = wp.tid()
    found = wp.mesh_query_point_sign_normal(mesh, points[k], farthest)
    face[k] = -1
    if found.result:
        face[k] = found.face
        sign[k] = found.sign
