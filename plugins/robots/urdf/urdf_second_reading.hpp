#pragma once

#include <string_view>
#include <vector>

#include <sidestep/core/error.hpp>

#include "urdf_file.hpp"

namespace sidestep::urdf_robot {

/// Reads the collision shapes of a URDF's text once more, by code that shares nothing with the
/// first reading: neither parser of XML, nor of numbers, nor rules. Appends to `errors` each shape
/// of the model that is not the same: its link, kind, sizes, file, scale, or where it is. What the
/// text has more or fewer of, check_counts() says.
void check_second_reading(const UrdfModel& model, std::string_view text,
                          std::vector<Error>& errors);

}  // namespace sidestep::urdf_robot
