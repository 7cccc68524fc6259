#include "urdf_outline.hpp"

#include <tinyxml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <string_view>

namespace sidestep::urdf_robot {
namespace {

enum class Value { kText, kAny, kPositive, kNotNegative, kNotZero };

struct AttributeRule {
  std::string_view element;
  std::string_view name;
  Value value;
  std::size_t numbers = 1;
  bool is_required = false;
};

/// All attributes of the elements that are read for their attributes.
constexpr AttributeRule kAttributes[] = {
    {"origin", "xyz", Value::kAny, 3},
    {"origin", "rpy", Value::kAny, 3},
    {"box", "size", Value::kPositive, 3, true},
    {"sphere", "radius", Value::kPositive, 1, true},
    {"cylinder", "radius", Value::kPositive, 1, true},
    {"cylinder", "length", Value::kPositive, 1, true},
    {"mesh", "filename", Value::kText, 0, true},
    {"mesh", "scale", Value::kNotZero, 3},
    {"axis", "xyz", Value::kAny, 3, true},
    {"limit", "lower", Value::kAny},
    {"limit", "upper", Value::kAny},
    {"limit", "velocity", Value::kNotNegative},
    {"limit", "effort", Value::kNotNegative},
    {"mimic", "joint", Value::kText, 0, true},
    {"mimic", "multiplier", Value::kAny},
    {"mimic", "offset", Value::kAny},
    {"parent", "link", Value::kText, 0, true},
    {"child", "link", Value::kText, 0, true},
};

enum class Child { kRead, kReadOnce, kPassedOver };

struct ChildRule {
  std::string_view element;
  std::string_view name;
  Child child;
};

/// The elements that URDF has. A shape is one of <geometry>'s, of which there is one.
constexpr ChildRule kChildren[] = {
    {"robot", "link", Child::kRead},
    {"robot", "joint", Child::kRead},
    {"robot", "material", Child::kPassedOver},
    {"robot", "transmission", Child::kPassedOver},
    {"robot", "gazebo", Child::kPassedOver},
    {"link", "collision", Child::kRead},
    {"link", "visual", Child::kPassedOver},
    {"link", "inertial", Child::kPassedOver},
    {"collision", "origin", Child::kReadOnce},
    {"collision", "geometry", Child::kReadOnce},
    {"collision", "verbose", Child::kPassedOver},
    {"collision", "material", Child::kPassedOver},
    {"collision", "contact_coefficients", Child::kPassedOver},
    {"geometry", "box", Child::kRead},
    {"geometry", "sphere", Child::kRead},
    {"geometry", "cylinder", Child::kRead},
    {"geometry", "mesh", Child::kRead},
    {"joint", "origin", Child::kReadOnce},
    {"joint", "parent", Child::kReadOnce},
    {"joint", "child", Child::kReadOnce},
    {"joint", "axis", Child::kReadOnce},
    {"joint", "limit", Child::kReadOnce},
    {"joint", "mimic", Child::kReadOnce},
    {"joint", "dynamics", Child::kPassedOver},
    {"joint", "calibration", Child::kPassedOver},
    {"joint", "safety_controller", Child::kPassedOver},
};

/// Elements that are the robot, wherever URDF has no place for them.
constexpr std::string_view kParts[] = {"link", "joint", "collision"};

/// Blocks of other readers, who have links, joints and geometries of their own.
constexpr std::string_view kForeign[] = {"gazebo", "transmission", "ros2_control", "sensor",
                                         "mujoco", "raisim",       "sdf",          "webots"};

/// An element whose name is longer or shorter than a near one of URDF's is another reader's.
constexpr std::size_t kMostExtraLetters = 2;

std::string lower_case(std::string text) {
  std::ranges::transform(text, text.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return text;
}

std::vector<std::string> words_of(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  std::vector<std::string> words;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kSpace), text.size()));
    if (text.empty()) return words;
    const std::size_t end = std::min(text.find_first_of(kSpace), text.size());
    words.emplace_back(text.substr(0, end));
    text.remove_prefix(end);
  }
}

/// A finite decimal number, and nothing else.
std::optional<double> number_of(std::string_view word) {
  if (word.starts_with('+')) {
    word.remove_prefix(1);
    if (word.starts_with('-')) return {};
  }
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return {};
  return value;
}

bool fits(double value, Value rule) noexcept {
  switch (rule) {
    case Value::kPositive: return value > 0.0;
    case Value::kNotNegative: return value >= 0.0;
    case Value::kNotZero: return value != 0.0;
    default: return true;
  }
}

std::string expected_by(const AttributeRule& rule) {
  if (rule.value == Value::kText) return "a name";
  const std::string numbers =
      rule.numbers == 1 ? "a number" : std::to_string(rule.numbers) + " numbers";
  switch (rule.value) {
    case Value::kPositive: return numbers + " above 0";
    case Value::kNotNegative: return numbers + " of at least 0";
    case Value::kNotZero: return numbers + " other than 0";
    default: return numbers;
  }
}

std::string tag(std::string_view name) {
  std::string text = "<";
  text += name;
  return text += '>';
}

std::string did_you_mean(const std::string& name) {
  return name.empty() ? std::string() : "did you mean '" + name + "'?";
}

/// One of the same letters before others as near: 'ryp' is 'rpy', not 'xyz'.
std::string nearest_attribute(const std::string& name, const std::vector<std::string>& names) {
  const auto same = std::ranges::find_if(
      names, [&](const std::string& one) { return std::ranges::is_permutation(one, name); });
  return same != names.end() ? *same : nearest_name(name, names);
}

bool is_namespaced(std::string_view name) { return name.find(':') != std::string_view::npos; }

bool is_foreign(std::string_view name) {
  return is_namespaced(name) || std::ranges::find(kForeign, name) != std::end(kForeign);
}

/// Whether a name has another's letters, but for their order or a place in which up to a quarter
/// of them are others.
bool is_near(std::string_view name, std::string_view other) {
  const std::string lower = lower_case(std::string(name));
  if (std::ranges::is_permutation(lower, other)) return true;
  const std::size_t most = std::min(lower.size(), other.size());
  const auto first = std::mismatch(lower.begin(), lower.begin() + static_cast<std::ptrdiff_t>(most),
                                   other.begin());
  const auto head = static_cast<std::size_t>(first.first - lower.begin());
  const auto last = std::mismatch(
      lower.rbegin(), lower.rbegin() + static_cast<std::ptrdiff_t>(most - head), other.rbegin());
  const auto tail = static_cast<std::size_t>(last.first - lower.rbegin());
  return head + tail + other.size() / 4 >= std::max(lower.size(), other.size());
}

bool holds_geometry(const TiXmlElement& element) {
  for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (is_near(child->ValueStr(), "geometry")) return true;
  }
  return false;
}

class RuleCheck {
 public:
  RuleCheck(std::string file, std::vector<Error>& errors)
      : file_(std::move(file)), errors_(errors) {}

  bool check(TiXmlElement& robot) {
    if (const TiXmlElement* xacro = first_xacro(robot)) {
      report(*xacro, "this is a xacro file, not yet a URDF",
             "expand it first: xacro " + file_ + " > robot.urdf");
      return false;
    }
    check_children(robot, "robot");
    for (TiXmlElement* child = robot.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      const char* name = child->Attribute("name");
      whose_ = child->ValueStr() + " '" + (name == nullptr ? "" : name) + "'";
      if (child->ValueStr() == "link") check_link(*child);
      if (child->ValueStr() == "joint") check_joint(*child);
    }
    return true;
  }

 private:
  void report(const TiXmlBase& where, std::string message, std::string hint = {}) {
    const SourceMark mark{file_, where.Row(), where.Column()};
    errors_.push_back({ErrorCode::kConfig, std::move(message), mark.to_string(), std::move(hint)});
  }

  static const TiXmlElement* first_xacro(const TiXmlElement& element) {
    if (element.ValueStr().starts_with("xacro:")) return &element;
    for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (const TiXmlElement* found = first_xacro(*child)) return found;
    }
    return nullptr;
  }

  void check_link(TiXmlElement& link) {
    check_children(link, "link");
    for (TiXmlElement* child = link.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (child->ValueStr() == "collision") check_collision(*child);
    }
  }

  void check_collision(TiXmlElement& collision) {
    check_children(collision, "collision");
    if (TiXmlElement* origin = collision.FirstChildElement("origin")) check_attributes(*origin);
    TiXmlElement* geometry = collision.FirstChildElement("geometry");
    TiXmlElement* shape = geometry == nullptr ? nullptr : geometry->FirstChildElement();
    if (shape == nullptr) {
      report(collision, "a <collision> of " + whose_ + " has no geometry");
      return;
    }
    for (; shape != nullptr; shape = shape->NextSiblingElement()) {
      if (rule_of("geometry", shape->ValueStr()) == nullptr) {
        report(
            *shape,
            whose_ + " has a collision geometry that URDF does not know: " + tag(shape->ValueStr()),
            "use box, sphere, cylinder or mesh");
      } else if (shape != geometry->FirstChildElement()) {
        report(*shape, whose_ + " has a <geometry> of several shapes",
               "give each its own <collision>");
      } else {
        check_attributes(*shape);
      }
    }
  }

  void check_joint(TiXmlElement& joint) {
    check_children(joint, "joint");
    for (TiXmlElement* child = joint.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      const ChildRule* rule = rule_of("joint", child->ValueStr());
      if (rule != nullptr && rule->child == Child::kReadOnce) check_attributes(*child);
    }
    const char* type = joint.Attribute("type");
    if (TiXmlElement* limit = joint.FirstChildElement("limit")) {
      check_limit(*limit, type == nullptr ? "" : type);
    }
  }

  void check_limit(const TiXmlElement& limit, std::string_view type) {
    const bool has_ends = type == "revolute" || type == "prismatic";
    if (has_ends || type == "continuous") {
      for (const char* name : {"lower", "upper", "velocity"}) {
        const bool is_needed = has_ends || name == std::string_view("velocity");
        if (is_needed && limit.Attribute(name) == nullptr) report_missing(limit, name, "a number");
      }
    }
    const char* lower = limit.Attribute("lower");
    const char* upper = limit.Attribute("upper");
    if (lower == nullptr || upper == nullptr) return;
    const auto least = number_of(lower);
    const auto most = number_of(upper);
    if (least && most && *least > *most) {
      report(limit, whose_ + " has its lower limit above its upper one");
    }
  }

  static const ChildRule* rule_of(std::string_view parent, std::string_view name) {
    const auto* found = std::ranges::find_if(kChildren, [&](const ChildRule& rule) {
      return rule.element == parent && rule.name == name;
    });
    return found == std::end(kChildren) ? nullptr : found;
  }

  /// A name of URDF's that this one is a misspelling of; empty if it is another reader's.
  static std::string meant_by(std::string_view parent, const std::string& name) {
    const std::string lower = lower_case(name);
    std::vector<std::string> names;
    for (const ChildRule& rule : kChildren) {
      if (rule.element != parent) continue;
      if (rule.name == lower) return lower;
      names.emplace_back(rule.name);
    }
    const std::string nearest = nearest_name(lower, names);
    const auto letters = static_cast<std::ptrdiff_t>(lower.size());
    const auto extra = std::abs(letters - static_cast<std::ptrdiff_t>(nearest.size()));
    return static_cast<std::size_t>(extra) <= kMostExtraLetters ? nearest : std::string();
  }

  [[nodiscard]] std::string in_a(std::string_view parent) const {
    return " in a " + tag(parent) + (whose_.empty() ? "" : " (" + whose_ + ")");
  }

  /// That what is read stands here, and once.
  void check_children(const TiXmlElement& element, std::string_view parent) {
    const bool is_closed = parent == "collision";
    for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      const std::string& name = child->ValueStr();
      if (const ChildRule* rule = rule_of(parent, name)) {
        if (rule->child == Child::kReadOnce && child != element.FirstChildElement(name.c_str())) {
          report(*child, "a second " + tag(name) + in_a(parent));
        }
        if (!is_read_inside(name)) check_passed_over(*child, true);
        continue;
      }
      if (report_misplaced(*child, parent)) continue;
      const bool is_others = is_namespaced(name);
      const std::string meant = is_others ? std::string() : meant_by(parent, name);
      if (meant.empty() && (is_others || !is_closed)) {
        if (!report_geometry(*child, parent)) check_passed_over(*child, false);
        continue;
      }
      report(*child, "URDF has no " + tag(name) + in_a(parent), did_you_mean(meant));
    }
  }

  /// Whether the children of such an element are checked by rules of their own.
  static bool is_read_inside(std::string_view name) {
    return name == "geometry" || std::ranges::find(kParts, name) != std::end(kParts);
  }

  /// Whether the element is a part of the robot, which stands where nobody looks for it.
  bool report_misplaced(const TiXmlElement& element, std::string_view parent) {
    const std::string& name = element.ValueStr();
    if (is_namespaced(name)) return false;
    const auto* const part =
        std::ranges::find_if(kParts, [&](std::string_view one) { return is_near(name, one); });
    if (part == std::end(kParts)) return false;
    if (rule_of(parent, *part) != nullptr) return false;  // misspelt, but in its place
    report(element, "a " + tag(name) + in_a(parent) + " is not read",
           *part == "collision" ? "put it into a <link>" : "put it right into the <robot>");
    return true;
  }

  /// Whether the element is or holds a geometry that only a <collision> of a <link> may hold.
  bool report_geometry(const TiXmlElement& element, std::string_view parent) {
    const std::string& name = element.ValueStr();
    const std::string_view local = std::string_view(name).substr(name.find(':') + 1);
    if (is_namespaced(name) ? !is_near(local, "collision") : is_foreign(name)) return false;
    if (!is_namespaced(name) && is_near(name, "geometry")) {
      if (parent == "visual") return false;
      report(element, "a " + tag(name) + in_a(parent) + " is not read",
             "put it into a <collision>");
      return true;
    }
    if (name == "visual" || !holds_geometry(element)) return false;
    report(element, "URDF has no " + tag(name) + in_a(parent) + ", so its <geometry> is not read",
           did_you_mean("collision"));
    return true;
  }

  /// What is passed over has no geometry, and no part of the robot if the element is URDF's own.
  void check_passed_over(const TiXmlElement& element, bool is_urdfs) {
    const std::string& parent = element.ValueStr();
    if (is_foreign(parent)) return;
    for (const TiXmlElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (is_urdfs && report_misplaced(*child, parent)) continue;
      if (!report_geometry(*child, parent)) check_passed_over(*child, is_urdfs);
    }
  }

  void report_missing(const TiXmlElement& element, std::string_view name,
                      const std::string& expected) {
    report(element, tag(element.ValueStr()) + " of " + whose_ + " needs the attribute '" +
                        std::string(name) + "': " + expected);
  }

  void check_attributes(TiXmlElement& element) {
    std::vector<std::string> names;
    for (const AttributeRule& rule : kAttributes) {
      if (rule.element != element.ValueStr()) continue;
      names.emplace_back(rule.name);
      const bool is_there = element.Attribute(names.back()) != nullptr;
      if (rule.is_required && !is_there) report_missing(element, rule.name, expected_by(rule));
    }
    for (TiXmlAttribute* attribute = element.FirstAttribute(); attribute != nullptr;
         attribute = attribute->Next()) {
      const auto* const rule = std::ranges::find_if(kAttributes, [&](const AttributeRule& one) {
        return one.element == element.ValueStr() && one.name == attribute->Name();
      });
      if (rule != std::end(kAttributes)) {
        check_value(element, *rule, *attribute);
        continue;
      }
      const std::string nearest = nearest_attribute(lower_case(attribute->Name()), names);
      report(*attribute,
             tag(element.ValueStr()) + " of " + whose_ + " has the attribute '" +
                 attribute->Name() + "', which URDF does not know",
             did_you_mean(nearest));
    }
  }

  void check_value(const TiXmlElement& element, const AttributeRule& rule,
                   TiXmlAttribute& attribute) {
    const std::string value = attribute.ValueStr();
    const std::vector<std::string> words = words_of(value);
    const auto is_right = [&](const std::string& word) {
      const auto number = number_of(word);
      return number && fits(*number, rule.value);
    };
    const bool is_text = rule.value == Value::kText;
    if (is_text ? !value.empty()
                : words.size() == rule.numbers && std::ranges::all_of(words, is_right)) {
      if (!is_text) set_words(words, attribute);
      return;
    }
    const bool has_comma = !is_text && value.find(',') != std::string::npos;
    report(attribute,
           tag(element.ValueStr()) + " of " + whose_ + " has " + attribute.Name() + "=\"" + value +
               "\", expected " + expected_by(rule),
           has_comma ? "decimals have a point, and spaces stand between numbers" : "");
  }

  static void set_words(const std::vector<std::string>& words, TiXmlAttribute& attribute) {
    std::string text;
    for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
    attribute.SetValue(text);
  }

  std::string file_;
  std::vector<Error>& errors_;
  std::string whose_;  ///< The link or joint that is being checked; empty around them.
};

}  // namespace

bool check_rules(TiXmlElement& robot, const std::string& file, std::vector<Error>& errors) {
  return RuleCheck(file, errors).check(robot);
}

}  // namespace sidestep::urdf_robot
