#include <sidestep/problems/problem_set.hpp>
#include <sidestep/problems/recorded_problems.hpp>

#include "fuzzing.hpp"
#include "problem_robot.hpp"
#include "support/temporary_folder.hpp"

using namespace sidestep;
using namespace sidestep::fuzzing;

// JSON, as a set of problems and as problems that a peer has solved.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const testing_support::TemporaryFolder folder;
  const auto file = folder.write("set.json", text_of(data, size));
  const auto set = read_problem_set(file, shoulder_and_elbow());
  if (is_read(set, file.string())) require_sound(*set);
  const auto recorded = read_recorded_problems(file);
  if (is_read(recorded, file.string())) {
    for (const Eigen::VectorXd& q : recorded->configurations) {
      require(q.size() == recorded->robot->description().dof() && q.allFinite(),
              "a configuration has a number for each joint");
    }
  }
  return 0;
}
