#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/node.hpp>

class TiXmlDocument;

namespace sidestep::urdf_robot {

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
