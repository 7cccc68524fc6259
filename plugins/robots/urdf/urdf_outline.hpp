#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/core/node.hpp>

class TiXmlElement;

namespace sidestep::urdf_robot {

/// Checks that all that Sidestep reads of a <robot> stands where it is read, under its own name,
/// once, and whole: origins, shapes, axes, limits and mimicry, each number of them. urdfdom passes
/// over much of what it cannot read. Appends every mistake to `errors`, with file:line:col. Numbers
/// are set apart by single spaces, as urdfdom needs them. False for a file of xacro's, of which
/// that alone is said.
[[nodiscard]] bool check_rules(TiXmlElement& robot, const std::string& file,
                               std::vector<Error>& errors);

/// The <collision> elements right under the <link>s right under the <robot>s of a URDF's text,
/// counted without any parser of XML: what a parser lost is missed.
[[nodiscard]] std::size_t count_collisions(std::string_view text);

/// What a URDF's text says before any number is used: names, who hangs on whom, and where in
/// the file it stands. urdfdom gives no positions, prints its complaints, and passes over what it
/// cannot read; this finds the mistakes first and hands it a document that it accepts.
struct UrdfOutline {
  struct Link {
    std::string name;
    SourceMark mark;
    int parent_joint = -1;          ///< Index into joints.
    std::vector<int> child_joints;  ///< Indices into joints, in the file's order.
    bool has_visual = false;
    std::vector<SourceMark> collisions;
  };
  struct Joint {
    std::string name;
    std::string type;
    std::string parent;
    std::string child;
    std::string mimic;        ///< Empty if it mimics none.
    bool has_limits = false;  ///< The file has a <limit>.
    SourceMark mark;
  };
  std::string robot_name;
  std::vector<Link> links;
  std::vector<Joint> joints;
  std::vector<int> order;    ///< Of the links: parents before children.
  std::string reduced_text;  ///< The document with links' collisions and joints alone.

  [[nodiscard]] int link(const std::string& name) const noexcept;   ///< -1 if there is none.
  [[nodiscard]] int joint(const std::string& name) const noexcept;  ///< -1 if there is none.
};

/// Outlines a URDF's text; `file` stands in the marks. Appends every mistake to `errors`.
[[nodiscard]] UrdfOutline outline_urdf(const std::string& text, const std::string& file,
                                       std::vector<Error>& errors);

}  // namespace sidestep::urdf_robot
