#include <stdexcept>

#include <gmock/gmock.h>

#include <sidestep/runtime/session.hpp>

namespace sidestep {
namespace {

TEST(Session, RefusesProgramsWithTheHeadersOfAnotherVersion) {
  EXPECT_NO_THROW(Session());
  const auto of = [](std::uint16_t major, std::uint16_t minor) {
    const Session session({}, nullptr, {major, minor});
  };
  EXPECT_THAT([&] { of(kSdkMajor, kSdkMinor + 1); },
              ::testing::ThrowsMessage<std::runtime_error>(::testing::HasSubstr("build it anew")));
  EXPECT_THROW(of(kSdkMajor, kSdkMinor - 1), std::runtime_error);
  EXPECT_THROW(of(kSdkMajor + 1, kSdkMinor), std::runtime_error);
}

}  // namespace
}  // namespace sidestep
