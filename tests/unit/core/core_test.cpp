#include <cmath>
#include <cstdint>
#include <limits>
#include <set>

#include <gtest/gtest.h>

#include <sidestep/core/error.hpp>
#include <sidestep/core/scratch.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/core/time.hpp>

namespace sidestep {
namespace {

TEST(Error, DescribesWhereWhatHintAndCause) {
  const Error inner{ErrorCode::kIo, "cannot be read", "a.png", "", nullptr};
  const Error outer = inner.wrapped(ErrorCode::kBadFrame, "frame 7 is unusable", "depth_sequence");
  EXPECT_EQ(outer.describe(),
            "depth_sequence: frame 7 is unusable\n  because a.png: cannot be read");
  const Error hinted{ErrorCode::kConfig, "unknown key", "a.yaml:1:2", "did you mean 'b'?", nullptr};
  EXPECT_EQ(hinted.describe(), "a.yaml:1:2: unknown key (did you mean 'b'?)");
}

TEST(Scratch, GivesBackWhatAScopeTook) {
  Scratch scratch;
  double* first = nullptr;
  {
    Scratch::Scope scope(scratch);
    first = scope.doubles(10).data();
  }
  Scratch::Scope scope(scratch);
  EXPECT_EQ(scope.doubles(10).data(), first);
}

TEST(Scratch, NestedScopesDoNotOverlapAndLinesAreAligned) {
  Scratch scratch;
  Scratch::Scope outer(scratch);
  const auto a = outer.doubles(3);
  // Larger than a chunk, so that the arena has to grow.
  Scratch::Scope inner(scratch);
  const auto b = inner.doubles(100000);
  const auto c = inner.doubles(5);
  std::ranges::fill(a, 1.0);
  std::ranges::fill(b, 2.0);
  std::ranges::fill(c, 3.0);
  for (const double value : a) EXPECT_EQ(value, 1.0);
  for (const double value : b) ASSERT_EQ(value, 2.0);
  for (const auto* data : {a.data(), b.data(), c.data()}) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(data) % 64, 0u);
  }
}

TEST(Seed, IsFnv1aMixedBySplitMix64) {
  // Published values: FNV-1a of "" and "foobar"; the first number of SplitMix64 seeded 1234567.
  constexpr std::uint64_t kFnvOfNothing = 0xcbf29ce484222325u;
  constexpr std::uint64_t kFnvOfFoobar = 0x85944171f73967e8u;
  constexpr std::uint64_t kSplitMixOf1234567 = 6457827717110365317u;
  EXPECT_EQ(derive_seed(1234567u - kFnvOfNothing, ""), kSplitMixOf1234567);
  EXPECT_EQ(derive_seed(1234567u - kFnvOfFoobar, "foobar"), kSplitMixOf1234567);
}

TEST(Seed, IsFixedDiffersByPartAndByRun) {
  EXPECT_EQ(derive_seed(7, "simulator"), derive_seed(7, "simulator"));
  std::set<std::uint64_t> seeds;
  for (std::uint64_t run = 0; run < 100; ++run) {
    for (const char* part : {"simulator", "ompl", "gp_chain"}) seeds.insert(derive_seed(run, part));
  }
  EXPECT_EQ(seeds.size(), 300u);
}

TEST(Deadline, ExpiresAtItsTimeOrOnRequest) {
  EXPECT_FALSE(Deadline().expired());
  EXPECT_TRUE(std::isinf(Deadline().remaining_s()));
  EXPECT_TRUE(Deadline::after_s(-1.0).expired());
  EXPECT_FALSE(Deadline::after_s(1e6).expired());
  std::stop_source stop;
  const Deadline deadline = Deadline::after_s(1e6, stop.get_token());
  EXPECT_FALSE(deadline.expired());
  stop.request_stop();
  EXPECT_TRUE(deadline.expired());
  EXPECT_TRUE(deadline.stop_requested());
  EXPECT_EQ(deadline.remaining_s(), 0.0);
}

TEST(Deadline, ATimeTooFarForTheClockNeverComes) {
  for (const double seconds : {1e10, 1e300, std::numeric_limits<double>::infinity()}) {
    EXPECT_FALSE(Deadline::after_s(seconds).expired()) << seconds;
    EXPECT_GT(Deadline::after_s(seconds).remaining_s(), 1e9) << seconds;
    EXPECT_TRUE(Deadline::after_s(-seconds).expired()) << -seconds;
    EXPECT_LE(Deadline::after_s(1.0).capped_s(seconds).remaining_s(), 1.0) << seconds;
  }
}

TEST(Deadline, ACapNeverExtendsIt) {
  EXPECT_TRUE(Deadline::after_s(-1.0).capped_s(1e6).expired());
  EXPECT_TRUE(Deadline::after_s(1e6).capped_s(-1.0).expired());
  EXPECT_LE(Deadline().capped_s(5.0).remaining_s(), 5.0);
}

TEST(Stamp, RoundsToTheNearestNanosecond) {
  EXPECT_EQ(Stamp::from_seconds(0.1).ns, 100000000);
  EXPECT_EQ(Stamp::from_seconds(-1.5).ns, -1500000000);
  EXPECT_DOUBLE_EQ(Stamp{2500000000}.seconds(), 2.5);
}

}  // namespace
}  // namespace sidestep
