#include "sphere_profile.hpp"

#include <fstream>
#include <iterator>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "profile_fixture.hpp"

namespace sidestep {
namespace {

namespace fs = std::filesystem;
using testing_support::ProfileFixture;

class SphereProfileTest : public ProfileFixture {};

TEST_F(SphereProfileTest, SavesSpheresAndNothingElse) {
  auto profile = open();
  ASSERT_TRUE(profile) << profile.error().describe();
  std::vector<CollisionSphere> spheres = profile->robot()->description().spheres;
  spheres[0].radius_m = 0.1234;
  const std::string before = profile->revision();
  const auto saved = profile->save(spheres);
  ASSERT_TRUE(saved) << saved.error().describe();
  EXPECT_NE(profile->revision(), before);
  std::string expected = kProfile;
  expected.replace(expected.find("radius_m: 0.2}"), 13, "radius_m: 0.1234");
  EXPECT_EQ(text(), expected);
  // And again, of what is there now.
  spheres[0].radius_m = 0.2;
  ASSERT_TRUE(profile->save(spheres));
  EXPECT_EQ(text(), kProfile);
  EXPECT_EQ(entries(), 2) << "nothing is left beside the profile and its URDF";
}

TEST_F(SphereProfileTest, BadSpheresLeaveTheFileAlone) {
  auto profile = open();
  ASSERT_TRUE(profile);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const CollisionSphere& bad :
       {CollisionSphere{9, {0, 0, 0}, 0.1}, CollisionSphere{-1, {0, 0, 0}, 0.1},
        CollisionSphere{1, {0, 0, 0}, 0.0}, CollisionSphere{1, {0, nan, 0}, 0.1},
        CollisionSphere{1, {0, 0, 0}, nan}, CollisionSphere{1, {0, 0, 1e9}, 0.1}}) {
    const auto saved = profile->save({bad});
    ASSERT_FALSE(saved);
    EXPECT_EQ(saved.error().code, ErrorCode::kInvalidArgument);
  }
  EXPECT_FALSE(profile->save({}));
  EXPECT_EQ(text(), kProfile);
  EXPECT_EQ(entries(), 2);
}

TEST_F(SphereProfileTest, AFileThatWasChangedMeanwhileIsLeftAlone) {
  auto profile = open();
  ASSERT_TRUE(profile);
  const std::string theirs = std::string(kProfile) + "# mine\n";
  folder_.write("arm/profile.yaml", theirs);
  const auto saved = profile->save({{1, {0, 0, 0}, 0.1}});
  ASSERT_FALSE(saved);
  EXPECT_NE(saved.error().describe().find("changed meanwhile"), std::string::npos);
  EXPECT_EQ(text(), theirs);
}

TEST_F(SphereProfileTest, AProtectedFileIsNotWritten) {
  const fs::path file = folder_.path() / "arm/profile.yaml";
  fs::permissions(file, fs::perms::owner_read);
  auto profile = open();
  ASSERT_TRUE(profile);
  const auto writable = profile->check_writable();
  ASSERT_FALSE(writable);
  EXPECT_NE(writable.error().describe().find("--out FILE"), std::string::npos);
  EXPECT_FALSE(profile->save({{1, {0, 0, 0}, 0.1}}));
  EXPECT_EQ(text(), kProfile);
}

TEST_F(SphereProfileTest, AnUnknownProfileIsNamedWithTheNearest) {
  const auto profile = open("arms");
  ASSERT_FALSE(profile);
  EXPECT_EQ(profile.error().code, ErrorCode::kNotFound);
  EXPECT_NE(profile.error().describe().find("did you mean 'arm'?"), std::string::npos);
}

TEST_F(SphereProfileTest, ACopyElsewhereFindsItsUrdf) {
  fs::create_directories(folder_.path() / "mine/here");
  const fs::path out = folder_.path() / "mine/here/own.yaml";
  auto profile = open("arm", out);
  ASSERT_TRUE(profile) << profile.error().describe();
  const auto saved = profile->save({{1, {0, 0, 0.5}, 0.1}});
  ASSERT_TRUE(saved) << saved.error().describe();
  EXPECT_EQ(text(), kProfile);
  auto copy = open(out.string());
  ASSERT_TRUE(copy) << copy.error().describe();
  ASSERT_EQ(copy->robot()->description().spheres.size(), 1U);
  EXPECT_EQ(copy->robot()->description().spheres[0].centre_link_m.z(), 0.5);
  // What there is already is no new file.
  const auto again = open("arm", out);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::kIo);
}

TEST_F(SphereProfileTest, ALinkIsFollowedAndStays) {
  fs::create_directories(folder_.path() / "links");
  const fs::path link = folder_.path() / "links/arm.yaml";
  fs::create_symlink(folder_.path() / "arm/profile.yaml", link);
  auto profile = open(link.string());
  ASSERT_TRUE(profile) << profile.error().describe();
  ASSERT_TRUE(profile->save({{1, {0, 0, 0}, 0.1}}));
  EXPECT_TRUE(fs::is_symlink(link));
  EXPECT_NE(text(), kProfile);
}

}  // namespace
}  // namespace sidestep
