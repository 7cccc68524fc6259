#pragma once

#include <string>

#include <sidestep/geometry/shape.hpp>

namespace sidestep {

/// The triangles of a COLLADA file's scene, as its nodes place them, in metres by its <unit>. Its
/// <up_axis> is not applied: as in RViz and MoveIt, the axes are the file's own. What is not
/// understood (splines, skinned meshes, holes in polygons) is an error: a part that is left out
/// would make a robot smaller than it is.
[[nodiscard]] Result<Mesh> read_collada(const std::string& file, const std::string& text);

}  // namespace sidestep
