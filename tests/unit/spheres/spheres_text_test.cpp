#include "sphere_profile.hpp"

#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

namespace sidestep {
namespace {

const std::vector<Link> kLinks{{"base", -1}, {"arm", 0}, {"hand", 1}};

std::string edited_text(const std::string& text, const std::vector<CollisionSphere>& spheres) {
  std::vector<Error> errors;
  const auto document = parse_yaml(text, "profile.yaml", errors);
  EXPECT_TRUE(document);
  return with_spheres(text, *document, kLinks, spheres);
}

const char* const kBefore = R"(# top
name: a
spheres:  # all of them
  # the base
  - {link: base, centre_m: [0, 0, 0.10], radius_m: 0.2}   # kept as it is
  - {link: base, centre_m: [0, 0, 0.3], radius_m: 0.2}  # the upper one

  # the arm
  - link: arm
    centre_m: [0.1, 0, 0]
    radius_m: 0.05
# of the poses
poses: {p: [1]}
)";

TEST(SpheresText, StaysAsItIsWithTheSameSpheres) {
  const std::vector<CollisionSphere> same{
      {0, {0, 0, 0.1}, 0.2}, {0, {0, 0, 0.3}, 0.2}, {1, {0.1, 0, 0}, 0.05}};
  EXPECT_EQ(edited_text(kBefore, same), kBefore);
}

TEST(SpheresText, ChangesLinesOfChangedSpheresOnly) {
  const std::vector<CollisionSphere> spheres{
      {0, {0, 0, 0.1}, 0.2}, {0, {0, 0.5, 0.3}, 0.25}, {0, {1, 0, 0}, 0.01}, {2, {0, 0, 0}, 0.02}};
  EXPECT_EQ(edited_text(kBefore, spheres), R"(# top
name: a
spheres:  # all of them
  # the base
  - {link: base, centre_m: [0, 0, 0.10], radius_m: 0.2}   # kept as it is
  - {link: base, centre_m: [0, 0.5, 0.3], radius_m: 0.25}  # the upper one
  - {link: base, centre_m: [1, 0, 0], radius_m: 0.01}

  # the arm
  - {link: hand, centre_m: [0, 0, 0], radius_m: 0.02}
# of the poses
poses: {p: [1]}
)");
}

TEST(SpheresText, MakesAListWhereThereIsNoneALineEach) {
  const std::vector<CollisionSphere> one{{1, {0.25, -1, 0}, 0.5}};
  const std::string list = "spheres:\n  - {link: arm, centre_m: [0.25, -1, 0], radius_m: 0.5}\n";
  EXPECT_EQ(edited_text("name: a\n", one), "name: a\n\n" + list);
  EXPECT_EQ(edited_text("name: a", one), "name: a\n\n" + list);
  const std::string flow = "spheres: [{link: base, centre_m: [0, 0, 0], radius_m: 1}]\n";
  EXPECT_EQ(edited_text(flow + "# c\nname: a\n", one), list + "# c\nname: a\n");
}

TEST(SpheresText, NumbersAreReadBackAsTheyWere) {
  const double third = 1.0 / 3.0;
  std::vector<Error> errors;
  const auto document =
      parse_yaml(edited_text("name: a\n", {{1, {third, 1e-7, -0.0}, third}}), "x", errors);
  ASSERT_TRUE(document);
  const Node& item = document->find("spheres")->items()[0];
  EXPECT_EQ(*item.find("radius_m")->as_double(), third);
  EXPECT_EQ((*item.find("centre_m")->as_doubles(3))[0], third);
  EXPECT_EQ((*item.find("centre_m")->as_doubles(3))[1], 1e-7);
}

TEST(SpheresText, PathsAreReplacedWhereTheyStand) {
  std::vector<Error> errors;
  for (const std::string scalar : {"robot.urdf", "'robot.urdf'", "\"robot.urdf\""}) {
    const std::string text = "name: a\nurdf: " + scalar + "  # here\n";
    const auto document = parse_yaml(text, "x", errors);
    ASSERT_TRUE(document);
    EXPECT_EQ(with_path(text, *document->find("urdf"), "../b.urdf"),
              "name: a\nurdf: \"../b.urdf\"  # here\n");
  }
}

}  // namespace
}  // namespace sidestep
