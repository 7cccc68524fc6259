#include "srdf_file.hpp"

#include <tinyxml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include <sidestep/core/file.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/xml_tags.hpp>

namespace sidestep::urdf_robot {
namespace {

class SrdfReader {
 public:
  explicit SrdfReader(const std::filesystem::path& file) { srdf_.file = file; }

  [[nodiscard]] Result<Srdf> run() {
    const std::string text = SIDESTEP_TRY(read_file(srdf_.file));
    SIDESTEP_TRY(check_xml_depth(text, srdf_.file.string()));
    if (text.find('\0') != std::string::npos) {
      return fail(ErrorCode::kConfig, "the file has a byte of 0", srdf_.file.string());
    }
    TiXmlDocument document;
    document.Parse(text.c_str());
    if (document.Error()) {
      return fail(ErrorCode::kConfig, document.ErrorDesc(),
                  mark_at(document.ErrorRow(), document.ErrorCol()).to_string());
    }
    const TiXmlElement* const root = document.RootElement();
    if (root == nullptr || root->ValueStr() != "robot" ||
        root->FirstChildElement("link") != nullptr) {
      return fail(ErrorCode::kConfig, "expected an SRDF", srdf_.file.string());
    }
    if (const TiXmlElement* const second = root->NextSiblingElement()) {
      return wrong(*second, "the file goes on behind the end of its <robot>");
    }
    for (const TiXmlNode* node = root->FirstChild(); node != nullptr; node = node->NextSibling()) {
      SIDESTEP_TRY(check_no_text(*node));
      if (const TiXmlElement* const one = node->ToElement()) SIDESTEP_TRY(read(*one));
    }
    return std::move(srdf_);
  }

 private:
  [[nodiscard]] SourceMark mark_at(int row, int column) const {
    return {srdf_.file.string(), row, column};
  }
  [[nodiscard]] SourceMark mark(const TiXmlBase& where) const {
    return mark_at(where.Row(), where.Column());
  }
  [[nodiscard]] tl::unexpected<Error> wrong(const TiXmlBase& where, const std::string& what,
                                            const std::string& hint = {}) const {
    return fail(ErrorCode::kConfig, what, mark(where).to_string(), hint);
  }

  [[nodiscard]] Result<void> check_no_text(const TiXmlNode& node) const {
    if (node.ToText() == nullptr) return {};
    return wrong(node, "expected an element, found '" + node.ValueStr().substr(0, 40) + "'");
  }
  [[nodiscard]] Result<void> check_attributes(const TiXmlElement& element,
                                              const std::vector<std::string>& known) const {
    for (const TiXmlAttribute* one = element.FirstAttribute(); one != nullptr; one = one->Next()) {
      if (std::ranges::find(known, one->NameTStr()) != known.end()) continue;
      return wrong(*one, "<" + element.ValueStr() + "> has no attribute '" + one->Name() + "'",
                   did_you_mean(one->NameTStr(), known));
    }
    return {};
  }
  [[nodiscard]] tl::unexpected<Error> unknown(const TiXmlElement& element, const std::string& in,
                                              const std::vector<std::string>& known) const {
    return wrong(element, "<" + element.ValueStr() + "> is no element of <" + in + ">",
                 did_you_mean(element.ValueStr(), known, "known here: " + joined(known)));
  }

  [[nodiscard]] Result<void> read(const TiXmlElement& element) {
    const std::string& tag = element.ValueStr();
    if (tag == "group") return read_group(element);
    if (tag == "group_state") return read_pose(element);
    if (tag == "disable_collisions") return read_disabled(element);
    const std::vector<std::string> others{"end_effector",
                                          "virtual_joint",
                                          "passive_joint",
                                          "link_sphere_approximation",
                                          "joint_property",
                                          "enable_collisions",
                                          "disable_default_collisions"};
    const bool is_foreign = tag.find(':') != std::string::npos;
    if (!is_foreign && std::ranges::find(others, tag) == others.end()) {
      std::vector<std::string> known{"group", "group_state", "disable_collisions"};
      known.insert(known.end(), others.begin(), others.end());
      return unknown(element, "robot", known);
    }
    if (tag == "virtual_joint") {
      srdf_.virtual_joints.insert(SIDESTEP_TRY(attribute(element, "name")));
    }
    ++srdf_.passed_over[tag];
    return {};
  }

  [[nodiscard]] Result<void> read_disabled(const TiXmlElement& element) {
    SIDESTEP_TRY(check_attributes(element, {"link1", "link2", "reason"}));
    const std::string a = SIDESTEP_TRY(attribute(element, "link1"));
    srdf_.disabled.push_back({a, SIDESTEP_TRY(attribute(element, "link2")), mark(element)});
    return {};
  }

  [[nodiscard]] Result<std::string> attribute(const TiXmlElement& element, const char* name) const {
    if (const char* const text = element.Attribute(name)) return std::string(text);
    return fail(ErrorCode::kConfig,
                "<" + element.ValueStr() + "> has no attribute '" + std::string(name) + "'",
                mark(element).to_string());
  }

  [[nodiscard]] Result<void> read_group(const TiXmlElement& element) {
    SIDESTEP_TRY(check_attributes(element, {"name"}));
    Srdf::Group group{SIDESTEP_TRY(attribute(element, "name")), {}, {}, {}, {}};
    if (std::ranges::find(srdf_.groups, group.name, &Srdf::Group::name) != srdf_.groups.end()) {
      return wrong(element, "there is another group '" + group.name + "'");
    }
    for (const TiXmlNode* node = element.FirstChild(); node != nullptr;
         node = node->NextSibling()) {
      SIDESTEP_TRY(check_no_text(*node));
      const TiXmlElement* const part = node->ToElement();
      if (part == nullptr) continue;
      const std::string& tag = part->ValueStr();
      SIDESTEP_TRY(check_attributes(*part, tag == "chain"
                                               ? std::vector<std::string>{"base_link", "tip_link"}
                                               : std::vector<std::string>{"name"}));
      if (tag == "chain") {
        const std::string base = SIDESTEP_TRY(attribute(*part, "base_link"));
        group.chains.emplace_back(base, SIDESTEP_TRY(attribute(*part, "tip_link")));
      } else if (tag == "joint" || tag == "link" || tag == "group") {
        auto& names = tag == "joint" ? group.joints : tag == "link" ? group.links : group.groups;
        names.push_back(SIDESTEP_TRY(attribute(*part, "name")));
      } else {
        return unknown(*part, "group", {"chain", "joint", "link", "group"});
      }
    }
    srdf_.groups.push_back(std::move(group));
    return {};
  }

  [[nodiscard]] Result<void> read_pose(const TiXmlElement& element) {
    SIDESTEP_TRY(check_attributes(element, {"name", "group"}));
    Srdf::Pose pose{SIDESTEP_TRY(attribute(element, "name")), {}};
    for (const TiXmlNode* node = element.FirstChild(); node != nullptr;
         node = node->NextSibling()) {
      SIDESTEP_TRY(check_no_text(*node));
      const TiXmlElement* const joint = node->ToElement();
      if (joint == nullptr) continue;
      if (joint->ValueStr() != "joint") return unknown(*joint, "group_state", {"joint"});
      SIDESTEP_TRY(check_attributes(*joint, {"name", "value"}));
      const std::string name = SIDESTEP_TRY(attribute(*joint, "name"));
      const std::string text = SIDESTEP_TRY(attribute(*joint, "value"));
      double value = 0.0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
      if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
        return fail(ErrorCode::kConfig, "'" + text + "' is not a number", mark(*joint).to_string());
      }
      if (!pose.joints.emplace(name, value).second) {
        return wrong(*joint, "joint '" + name + "' stands in the pose twice");
      }
    }
    srdf_.poses.push_back(std::move(pose));
    return {};
  }

  Srdf srdf_;
};

}  // namespace

Result<Srdf> read_srdf(const std::filesystem::path& file) { return SrdfReader(file).run(); }

}  // namespace sidestep::urdf_robot
