#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/node.hpp>

class TiXmlElement;

namespace sidestep::urdf_robot {

/// Checks that all that Sidestep reads of a <robot> stands where it is read, under its own name,
/// once, and whole: origins, shapes, axes, limits and mimicry, each number of them. urdfdom passes
/// over much of what it cannot read. Appends every mistake to `errors`, with file:line:col. Numbers
/// are set apart by single spaces, as urdfdom needs them. False for a file of xacro's, of which
/// that alone is said.
[[nodiscard]] bool check_rules(TiXmlElement& robot, const std::string& file,
                               std::vector<Error>& errors);

/// The <collision> elements right under the <link>s right under the <robot>s of a URDF's text,
/// counted without any parser of XML: what a parser lost is missed.
[[nodiscard]] std::size_t count_collisions(std::string_view text);

}  // namespace sidestep::urdf_robot
