#include "srdf_file.hpp"

#include <tinyxml.h>

#include <charconv>
#include <cmath>
#include <string_view>

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
    for (const TiXmlElement* one = root->FirstChildElement(); one != nullptr;
         one = one->NextSiblingElement()) {
      if (one->ValueStr() == "group") SIDESTEP_TRY(read_group(*one));
      if (one->ValueStr() == "group_state") SIDESTEP_TRY(read_pose(*one));
      if (one->ValueStr() == "disable_collisions") {
        const std::string a = SIDESTEP_TRY(attribute(*one, "link1"));
        srdf_.disabled.push_back({a, SIDESTEP_TRY(attribute(*one, "link2")), mark(*one)});
      }
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
  [[nodiscard]] Result<std::string> attribute(const TiXmlElement& element, const char* name) const {
    if (const char* const text = element.Attribute(name)) return std::string(text);
    return fail(ErrorCode::kConfig,
                "<" + element.ValueStr() + "> has no attribute '" + std::string(name) + "'",
                mark(element).to_string());
  }

  [[nodiscard]] Result<void> read_group(const TiXmlElement& element) {
    Srdf::Group group{SIDESTEP_TRY(attribute(element, "name")), {}, {}, {}, {}};
    for (const TiXmlElement* part = element.FirstChildElement(); part != nullptr;
         part = part->NextSiblingElement()) {
      const std::string& tag = part->ValueStr();
      if (tag == "chain") {
        const std::string base = SIDESTEP_TRY(attribute(*part, "base_link"));
        group.chains.emplace_back(base, SIDESTEP_TRY(attribute(*part, "tip_link")));
      } else if (tag == "joint" || tag == "link" || tag == "group") {
        auto& names = tag == "joint" ? group.joints : tag == "link" ? group.links : group.groups;
        names.push_back(SIDESTEP_TRY(attribute(*part, "name")));
      }
    }
    srdf_.groups.push_back(std::move(group));
    return {};
  }

  [[nodiscard]] Result<void> read_pose(const TiXmlElement& element) {
    Srdf::Pose pose{SIDESTEP_TRY(attribute(element, "name")), {}};
    for (const TiXmlElement* joint = element.FirstChildElement("joint"); joint != nullptr;
         joint = joint->NextSiblingElement("joint")) {
      const std::string name = SIDESTEP_TRY(attribute(*joint, "name"));
      const std::string text = SIDESTEP_TRY(attribute(*joint, "value"));
      double value = 0.0;
      const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
      if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
        return fail(ErrorCode::kConfig, "'" + text + "' is not a number", mark(*joint).to_string());
      }
      pose.joints[name] = value;
    }
    srdf_.poses.push_back(std::move(pose));
    return {};
  }

  Srdf srdf_;
};

}  // namespace

Result<Srdf> read_srdf(const std::filesystem::path& file) { return SrdfReader(file).run(); }

}  // namespace sidestep::urdf_robot
