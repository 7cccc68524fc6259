#include "conformance/test_host.hpp"
#include "fuzzing.hpp"
#include "rosbag_source.hpp"
#include "support/ball_robot.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// As source rosbag reads it: the frames of the topic of images, then those of the topic of clouds
// with the joints x, y and z.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("input.bag", text_of(data, size));
  for (const char* topic : {"/depth", "/cloud"}) {
    conformance::TestHost host(1, {.robot = std::make_shared<testing_support::BallRobot>(0.1)});
    rosbag::Options options;
    options.path = file;
    options.topic = topic;
    if (options.topic == "/cloud") options.joints.emplace();
    const auto source = rosbag::create_source(options, host.context());
    if (!is_read(source, file.string())) continue;
    for (std::size_t i = 0; i < size; ++i) {
      const auto frame = (*source)->next(Deadline());
      if (is_read(frame, "") && !*frame) break;
    }
  }
  return 0;
}
