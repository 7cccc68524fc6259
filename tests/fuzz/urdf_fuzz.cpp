#include "fuzzing.hpp"
#include "support/temporary_folder.hpp"
#include "urdf_file.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("robot.urdf", text_of(data, size));
  std::vector<Error> errors;
  const auto model = urdf_robot::read_urdf(file, errors);
  require(model.has_value() == errors.empty(), "there is a robot, or it is told why not");
  require_told(errors, file.string());
  if (!model) return 0;
  for (std::size_t i = 0; i < model->links.size(); ++i) {
    const urdf_robot::UrdfLink& link = model->links[i];
    require(link.parent < static_cast<int>(i) && link.joint.has_value() == (i > 0),
            "parents stand before children");
    for (const auto& shape : link.shapes) {
      require(shape.T_link_shape.matrix().allFinite() && shape.mesh_scale.allFinite(),
              "a shape's place is finite");
    }
    if (!link.joint) continue;
    require(link.joint->T_parent_joint.matrix().allFinite() && link.joint->axis.allFinite(),
            "a joint's place is finite");
    const auto limits = link.joint->limits.value_or(urdf_robot::UrdfLimits());
    require(std::isfinite(limits.lower + limits.upper + limits.velocity), "limits are finite");
  }
  return 0;
}
