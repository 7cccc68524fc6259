#include <gmock/gmock.h>

#include <cmath>

#include "closed_loop_run.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Under ThreadSanitizer, the command tells of a race and exits with a code of its own.
TEST(ClosedLoopThreads, MapWhatIsPlannedInAllTheWay) {
  const ClosedLoopRun run({"experiment.clock=wall", "experiment.duration_s=6"});
  SCOPED_TRACE(run.story());
  // Whether it gets there in time is the machine's affair.
  EXPECT_TRUE(run.finished.exit_code == 0 || run.finished.exit_code == 1);
  EXPECT_THAT(run.finished.error, Not(HasSubstr("ThreadSanitizer")));
  EXPECT_EQ(run.summary["episodes"], 1);
  EXPECT_GE(run.summary["frames"], 1);
  EXPECT_NE(run.first("planned", "goal"), nullptr);
}

}  // namespace
}  // namespace sidestep::testing
