#include "urdf_outline.hpp"

#include <tinyxml.h>

#include <algorithm>
#include <set>

#include <sidestep/core/index.hpp>
#include <sidestep/core/xml_tags.hpp>

namespace sidestep::urdf_robot {
namespace {

constexpr std::size_t kMostLinks = 1000;

class Outliner {
 public:
  Outliner(std::string file, std::vector<Error>& errors)
      : file_(std::move(file)), errors_(errors) {}

  UrdfOutline run(const std::string& text) {
    if (auto checked = check_xml_depth(text, file_); !checked) {
      errors_.push_back(std::move(checked.error()));
      return {};
    }
    TiXmlDocument document;
    document.Parse(text.c_str(), nullptr, TIXML_ENCODING_UTF8);
    if (document.Error()) {
      if (document.ErrorId() == TiXmlBase::TIXML_ERROR_DOCUMENT_EMPTY) {
        report({file_, 1, 1}, "expected a URDF, whose outermost element is <robot>");
      } else {
        report({file_, document.ErrorRow(), document.ErrorCol()},
               std::string("not well-formed XML: ") + document.ErrorDesc());
      }
      return {};
    }
    TiXmlElement* robot = document.RootElement();
    if (robot == nullptr || robot->ValueStr() != "robot") {
      report(robot == nullptr ? SourceMark{file_, 1, 1} : mark(*robot),
             "expected a URDF, whose outermost element is <robot>");
      return {};
    }
    if (!check_rules(*robot, file_, errors_)) return {};
    read_elements(*robot);
    if (!errors_.empty()) return std::move(outline_);
    connect();
    if (errors_.empty()) check_mimics();
    if (errors_.empty()) sort_links();
    if (errors_.empty()) outline_.reduced_text = reduced(*robot);
    return std::move(outline_);
  }

 private:
  SourceMark mark(const TiXmlElement& element) const {
    return {file_, element.Row(), element.Column()};
  }

  void report(const SourceMark& where, std::string message, std::string hint = {}) {
    errors_.push_back({ErrorCode::kConfig, std::move(message), where.to_string(), std::move(hint)});
  }

  static std::string text_of(const TiXmlElement& element, const char* name) {
    const char* value = element.Attribute(name);
    return value == nullptr ? "" : value;
  }

  /// An attribute that must be there and not be empty.
  std::string attribute(const TiXmlElement& element, const char* name) {
    std::string value = text_of(element, name);
    if (!value.empty()) return value;
    report(mark(element), "<" + element.ValueStr() + "> needs the attribute '" + name + "'");
    return {};
  }

  void read_elements(const TiXmlElement& robot) {
    const char* name = robot.Attribute("name");
    outline_.robot_name = name == nullptr || *name == '\0' ? "robot" : name;
    for (const TiXmlElement* element = robot.FirstChildElement(); element != nullptr;
         element = element->NextSiblingElement()) {
      const std::string& tag = element->ValueStr();
      if (is_too_large()) break;
      if (tag == "link") {
        read_link(*element);
      } else if (tag == "joint") {
        read_joint(*element);
      }
    }
    if (outline_.links.empty()) report(mark(robot), "the robot has no <link>");
    if (is_too_large()) {
      report(mark(robot), "the robot has more than " + std::to_string(kMostLinks) +
                              " links or joints, which are not read");
    }
  }

  /// Each is looked for among all before it.
  [[nodiscard]] bool is_too_large() const {
    return std::max(outline_.links.size(), outline_.joints.size()) > kMostLinks;
  }

  void read_link(const TiXmlElement& element) {
    UrdfOutline::Link link{attribute(element, "name"), mark(element)};
    if (link.name.empty()) return;
    if (outline_.link(link.name) != -1) {
      report(link.mark, "link '" + link.name + "' is defined twice");
      return;
    }
    for (const TiXmlElement* collision = element.FirstChildElement("collision");
         collision != nullptr; collision = collision->NextSiblingElement("collision")) {
      link.collisions.push_back(mark(*collision));
    }
    link.has_visual = element.FirstChildElement("visual") != nullptr;
    outline_.links.push_back(std::move(link));
  }

  void read_joint(const TiXmlElement& element) {
    // URDF's <transmission> and <ros2_control> have <joint>s too, but inside of themselves.
    UrdfOutline::Joint joint;
    joint.mark = mark(element);
    joint.name = attribute(element, "name");
    joint.type = attribute(element, "type");
    joint.parent = child_link(element, "parent");
    joint.child = child_link(element, "child");
    joint.has_limits = element.FirstChildElement("limit") != nullptr;
    if (const TiXmlElement* mimic = element.FirstChildElement("mimic"); mimic != nullptr) {
      joint.mimic = text_of(*mimic, "joint");
    }
    if (joint.name.empty() || joint.type.empty()) return;
    if (joint.type == "planar" || joint.type == "floating") {
      report(joint.mark, "joint '" + joint.name + "' is " + joint.type + ", which is not supported",
             "for a mobile base set 'base' to holonomic or differential and let the URDF begin at "
             "the base's link");
    } else if (joint.type != "fixed" && joint.type != "revolute" && joint.type != "continuous" &&
               joint.type != "prismatic") {
      report(joint.mark, "joint '" + joint.name + "' has the unknown type '" + joint.type + "'",
             "use fixed, revolute, continuous or prismatic");
    }
    if (outline_.joint(joint.name) != -1) {
      report(joint.mark, "joint '" + joint.name + "' is defined twice");
      return;
    }
    outline_.joints.push_back(std::move(joint));
  }

  std::string child_link(const TiXmlElement& joint, const char* tag) {
    const TiXmlElement* element = joint.FirstChildElement(tag);
    if (element != nullptr) return text_of(*element, "link");
    report(mark(joint), "joint '" + text_of(joint, "name") + "' has no <" + tag + ">");
    return {};
  }

  int link_or_report(const UrdfOutline::Joint& joint, const std::string& name) {
    const int index = outline_.link(name);
    if (index != -1) return index;
    std::vector<std::string> names;
    for (const UrdfOutline::Link& link : outline_.links) names.push_back(link.name);
    report(joint.mark,
           "joint '" + joint.name + "' names the link '" + name + "', which does not exist",
           did_you_mean(name, names));
    return -1;
  }

  void connect() {
    for (std::size_t j = 0; j < outline_.joints.size(); ++j) {
      const UrdfOutline::Joint& joint = outline_.joints[j];
      const int parent = link_or_report(joint, joint.parent);
      const int child = link_or_report(joint, joint.child);
      if (parent == -1 || child == -1) continue;
      UrdfOutline::Link& below = outline_.links[idx(child)];
      if (below.parent_joint != -1) {
        const auto& other = outline_.joints[idx(below.parent_joint)];
        report(joint.mark, "link '" + below.name + "' has two parents: joint '" + other.name +
                               "' and joint '" + joint.name + "'");
        continue;
      }
      below.parent_joint = static_cast<int>(j);
      outline_.links[idx(parent)].child_joints.push_back(static_cast<int>(j));
    }
  }

  void check_mimics() {
    for (const UrdfOutline::Joint& joint : outline_.joints) {
      std::set<std::string> seen{joint.name};
      std::string master = joint.mimic;
      while (!master.empty()) {
        const int index = outline_.joint(master);
        if (index == -1) {
          report(joint.mark,
                 "joint '" + joint.name + "' mimics '" + master + "', which does not exist");
          break;
        }
        if (!seen.insert(master).second) {
          report(joint.mark, "joint '" + joint.name + "' ends up mimicking itself");
          break;
        }
        const UrdfOutline::Joint& next = outline_.joints[idx(index)];
        if (next.type == "fixed" && joint.type != "fixed") {
          report(joint.mark, "joint '" + joint.name + "' mimics '" + master + "', which is fixed");
          break;
        }
        master = next.mimic;
      }
    }
  }

  void sort_links() {
    std::vector<int> roots;
    std::string names;
    for (std::size_t i = 0; i < outline_.links.size(); ++i) {
      if (outline_.links[i].parent_joint != -1) continue;
      roots.push_back(static_cast<int>(i));
      names += (names.empty() ? "'" : ", '") + outline_.links[i].name + "'";
    }
    if (roots.size() > 1) {
      report(outline_.links[idx(roots[1])].mark, "the robot has several root links: " + names,
             "join them by fixed joints");
      return;
    }
    std::vector<int> stack = roots;
    std::vector<bool> reached(outline_.links.size(), false);
    while (!stack.empty()) {
      const int index = stack.back();
      stack.pop_back();
      outline_.order.push_back(index);
      reached[idx(index)] = true;
      const auto& children = outline_.links[idx(index)].child_joints;
      for (auto it = children.rbegin(); it != children.rend(); ++it) {
        stack.push_back(outline_.link(outline_.joints[idx(*it)].child));
      }
    }
    const auto lost = std::ranges::find(reached, false);
    if (lost == reached.end()) return;
    const UrdfOutline::Link& link = outline_.links[idx(lost - reached.begin())];
    report(link.mark, "link '" + link.name + "' hangs on itself: the joints form a loop",
           "URDF describes trees only");
  }

  /// What of the document urdfdom is to see. Joints without limits get some, because it refuses
  /// them otherwise; has_limits remembers that they are not real.
  std::string reduced(const TiXmlElement& robot) const {
    TiXmlElement root("robot");
    root.SetAttribute("name", outline_.robot_name);
    for (const TiXmlElement* element = robot.FirstChildElement(); element != nullptr;
         element = element->NextSiblingElement()) {
      const std::string& tag = element->ValueStr();
      if (tag == "link") {
        TiXmlElement link("link");
        link.SetAttribute("name", element->Attribute("name"));
        copy_children(*element, {"collision"}, link);
        root.InsertEndChild(link);
      } else if (tag == "joint") {
        TiXmlElement joint("joint");
        joint.SetAttribute("name", element->Attribute("name"));
        joint.SetAttribute("type", element->Attribute("type"));
        copy_children(*element, {"origin", "axis", "parent", "child", "mimic"}, joint);
        joint.InsertEndChild(limits_of(*element));
        root.InsertEndChild(joint);
      }
    }
    TiXmlPrinter printer;
    root.Accept(&printer);
    return printer.Str();
  }

  static void copy_children(const TiXmlElement& from, const std::set<std::string>& tags,
                            TiXmlElement& to) {
    for (const TiXmlElement* child = from.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (tags.contains(child->ValueStr())) to.InsertEndChild(*child);
    }
  }

  static TiXmlElement limits_of(const TiXmlElement& joint) {
    TiXmlElement limits("limit");
    if (const TiXmlElement* given = joint.FirstChildElement("limit"); given != nullptr)
      limits = *given;
    for (const char* name : {"lower", "upper", "velocity"}) {
      if (limits.Attribute(name) == nullptr) limits.SetAttribute(name, "0");
    }
    limits.SetAttribute("effort", "0");
    return limits;
  }

  std::string file_;
  std::vector<Error>& errors_;
  UrdfOutline outline_;
};

template <class Named>
int index_of(const std::vector<Named>& items, const std::string& name) noexcept {
  const auto it = std::ranges::find(items, name, &Named::name);
  return it == items.end() ? -1 : static_cast<int>(it - items.begin());
}

}  // namespace

int UrdfOutline::link(const std::string& name) const noexcept { return index_of(links, name); }
int UrdfOutline::joint(const std::string& name) const noexcept { return index_of(joints, name); }

UrdfOutline outline_urdf(const std::string& text, const std::string& file,
                         std::vector<Error>& errors) {
  return Outliner(file, errors).run(text);
}

}  // namespace sidestep::urdf_robot
