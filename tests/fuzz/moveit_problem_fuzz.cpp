#include "fuzzing.hpp"
#include "problem_robot.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// A problem as MotionBenchMaker writes it: its scene, and what is asked.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto parts = parts_of(text_of(data, size), 2);
  (void)folder.write("set/scene0001.yaml", parts[0]);
  (void)folder.write("set/request0001.yaml", parts[1]);
  const auto set = read_moveit_family(folder.path() / "set", shoulder_and_elbow());
  if (is_read(set, folder.path().string())) require_sound(*set);
  return 0;
}
