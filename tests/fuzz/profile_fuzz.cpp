#include <fstream>
#include <iterator>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "fuzzing.hpp"
#include "load_robot.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// A profile beside the URDF of the robot that it begins with: "name: NAME" on its first line.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const std::string text = text_of(data, size);
  const auto file = folder.write("profile.yaml", text);
  std::filesystem::path robot = SIDESTEP_SOURCE_DIR "/robots/planar";
  for (const auto& entry : std::filesystem::directory_iterator(SIDESTEP_SOURCE_DIR "/robots")) {
    if (text.find("name: " + entry.path().filename().string() + "\n") != std::string::npos) {
      robot = entry.path();
    }
  }
  std::filesystem::copy_file(robot / "robot.urdf", folder.path() / "robot.urdf");
  conformance::TestHost host(
      1, {.robot_paths = {}, .documents = std::make_shared<YamlDocumentReader>()});
  urdf_robot::Options options;
  options.profile = Node(Node::Scalar{file.string(), true}, {"config.yaml", 1, 1});
  const auto tree = urdf_robot::load_robot(options, host.context());
  if (!is_read(tree, folder.path().string())) return 0;
  const RobotDescription& description = (*tree)->description();
  const std::vector<double> q(description.joints.size(), 0.0);
  std::vector<Eigen::Vector3d> centres(description.spheres.size());
  Scratch scratch;
  (*tree)->sphere_centres(q, centres, scratch);
  return 0;
}
