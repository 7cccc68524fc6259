#include "joint_table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/index.hpp>

namespace sidestep::urdf_robot {
namespace {

Joint::Type planned_type(UrdfJoint::Type type) {
  switch (type) {
    case UrdfJoint::Type::kContinuous: return Joint::Type::kContinuous;
    case UrdfJoint::Type::kPrismatic: return Joint::Type::kPrismatic;
    default: return Joint::Type::kRevolute;
  }
}

}  // namespace

JointTable::JointTable(const UrdfModel& model, const Profile& profile, std::vector<Error>& errors)
    : model_(model), profile_(profile), errors_(errors) {
  if (profile.base.drives()) add_base(profile.base);
  read_limits();
  read_fixed();
  choose_planned();
  of_profile_ = planned_;
  const auto groups = read_groups();
  if (!profile.group.is_null()) choose_group(groups);
}

void JointTable::add_base(const BaseOptions& base) {
  if (base.joints.size() != 3 || base.lower_m.size() != 2 || base.upper_m.size() != 2) return;
  has_base_ = true;
  for (std::size_t i = 0; i < 2; ++i) {
    planned_.push_back({base.joints[i], Joint::Type::kPrismatic, base.lower_m[i], base.upper_m[i],
                        base.max_velocity_mps, base.max_acceleration_mps2.value_or(kInfinity),
                        base.max_braking_mps2});
  }
  planned_.push_back(
      {base.joints[2], Joint::Type::kContinuous, -kInfinity, kInfinity, base.max_turn_rate_radps,
       base.max_turn_acceleration_radps2.value_or(kInfinity), base.max_turn_braking_radps2});
}

Error JointTable::unknown_joint(const Node& where, const std::string& name) const {
  std::vector<std::string> names = model_.joint_names();
  for (const Joint& joint : planned_) names.push_back(joint.name);
  return where.error("the URDF has no moving joint '" + name + "'", did_you_mean(name, names));
}

void JointTable::read_limits() {
  const Node& node = profile_.joint_limits;
  if (!node.is_map() && !node.is_null()) {
    errors_.push_back(
        node.error("'joint_limits' is a map from joints to limits, found " + node.kind()));
  }
  const Parameters<JointLimitOptions> fields = JointLimitOptions::parameters();
  for (const Node::Entry& entry : node.entries()) {
    const UrdfJoint* joint = model_.find_joint(entry.key);
    const auto of_base = std::ranges::find(planned_, entry.key, &Joint::name);
    const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
    const bool is_of_urdf = joint != nullptr && joint->type != UrdfJoint::Type::kFixed;
    if (!is_of_urdf && of_base == planned_.end()) {
      errors_.push_back(unknown_joint(key, entry.key));
      continue;
    }
    if (!entry.value.is_map()) {
      errors_.push_back(entry.value.error("expected a map of limits, found " + entry.value.kind()));
      continue;
    }
    const std::size_t before = errors_.size();
    check_against_schema(entry.value, fields.schema(), {}, errors_);
    if (of_base == planned_.end() || !std::isfinite(of_base->max_acceleration)) {
      check_braking(entry.value, "max_braking", "max_acceleration", errors_);
    }
    if (errors_.size() != before) continue;
    fields.read(entry.value, limits_[entry.key], errors_);
    if (of_base != planned_.end()) limit_base(limits_[entry.key], entry.value, *of_base);
  }
}

void JointTable::limit_base(const JointLimitOptions& own, const Node& where, Joint& joint) {
  joint.lower = own.lower.value_or(joint.lower);
  joint.upper = own.upper.value_or(joint.upper);
  joint.max_velocity = own.max_velocity.value_or(joint.max_velocity);
  joint.max_acceleration = own.max_acceleration.value_or(joint.max_acceleration);
  if (own.max_braking) joint.max_braking = own.max_braking;
  if (joint.type == Joint::Type::kContinuous && own.lower && own.upper) {
    joint.type = Joint::Type::kRevolute;
  }
  if (joint.lower > joint.upper) {
    errors_.push_back(
        where.error("joint '" + joint.name + "' has its lower limit above its upper one"));
  }
  if (joint.braking() < joint.max_acceleration) {
    errors_.push_back(where.error(
        "'max_braking' of '" + joint.name + "' is " + detail::number_text(joint.braking()) +
            ", below its 'max_acceleration', " + detail::number_text(joint.max_acceleration),
        "stops brake at least as hard as motions"));
  }
}

void JointTable::read_fixed() {
  const Node& node = profile_.fixed_joints;
  if (!node.is_map() && !node.is_null()) {
    errors_.push_back(
        node.error("'fixed_joints' is a map from joints to positions, found " + node.kind()));
  }
  for (const Node::Entry& entry : node.entries()) {
    const Node key(Node::Scalar{entry.key, false}, entry.key_mark);
    const UrdfJoint* joint = model_.find_joint(entry.key);
    const bool is_base = is_of_base(entry.key) && !profile_.group.is_null();
    if (!is_base && (joint == nullptr || joint->type == UrdfJoint::Type::kFixed)) {
      errors_.push_back(unknown_joint(key, entry.key));
      continue;
    }
    if (!is_base && joint->mimic) {
      errors_.push_back(key.error("joint '" + entry.key + "' cannot be fixed: it mimics '" +
                                  joint->mimic->joint + "'"));
      continue;
    }
    const auto value = entry.value.as_double();
    if (!value) {
      errors_.push_back(value.error());
      continue;
    }
    const auto [lower, upper] = is_base ? base_limits(entry.key) : position_limits(*joint);
    if (*value < lower || *value > upper) {
      errors_.push_back(
          entry.value.error("joint '" + entry.key + "' would be fixed outside of its limits, " +
                            detail::number_text(lower) + " to " + detail::number_text(upper)));
      continue;
    }
    fixed_[entry.key] = *value;
  }
}

std::pair<double, double> JointTable::position_limits(const UrdfJoint& joint) const {
  std::pair<double, double> limits(-kInfinity, kInfinity);
  if (joint.limits && joint.type != UrdfJoint::Type::kContinuous) {
    limits = {joint.limits->lower, joint.limits->upper};
  }
  if (const auto own = limits_.find(joint.name); own != limits_.end()) {
    limits.first = own->second.lower.value_or(limits.first);
    limits.second = own->second.upper.value_or(limits.second);
  }
  return limits;
}

std::vector<std::string> JointTable::default_joints() const {
  // Where a group is planned, others may be fixed that the profile plans, by the configuration.
  const auto is_fixed = [&](const std::string& name) {
    return fixed_.contains(name) &&
           (profile_.group.is_null() || profile_.fixed_by_profile.contains(name));
  };
  std::vector<std::string> names;
  if (profile_.tip_link.empty()) {
    for (const UrdfLink& link : model_.links) {
      const auto& joint = link.joint;
      if (joint && joint->type != UrdfJoint::Type::kFixed && !joint->mimic &&
          !is_fixed(joint->name))
        names.push_back(joint->name);
    }
    return names;
  }
  for (int link = model_.link_index(profile_.tip_link).value_or(0); link > 0;
       link = model_.links[idx(link)].parent) {
    const auto& joint = model_.links[idx(link)].joint;
    if (joint->type != UrdfJoint::Type::kFixed && !joint->mimic && !is_fixed(joint->name))
      names.insert(names.begin(), joint->name);
  }
  return names;
}

void JointTable::choose_planned() {
  const bool chosen = !profile_.joints.empty();
  if (!chosen && !profile_.tip_link.empty() && !model_.link_index(profile_.tip_link)) {
    errors_.push_back({ErrorCode::kConfig, "the URDF has no link '" + profile_.tip_link + "'",
                       model_.file.string(), did_you_mean(profile_.tip_link, model_.link_names())});
    return;
  }
  const std::vector<std::string> names = chosen ? profile_.joints : default_joints();
  for (std::size_t i = 0; i < names.size(); ++i) {
    const Node* item = profile_.item("joints", i);
    const Node where = item != nullptr ? *item : Node(Node::Scalar{}, {model_.file.string()});
    const UrdfJoint* joint = model_.find_joint(names[i]);
    if (joint == nullptr || joint->type == UrdfJoint::Type::kFixed) {
      errors_.push_back(unknown_joint(where, names[i]));
    } else if (joint->mimic) {
      errors_.push_back(where.error(
          "joint '" + names[i] + "' cannot be planned: it mimics '" + joint->mimic->joint + "'",
          "plan '" + joint->mimic->joint + "' instead"));
    } else if (fixed_.contains(names[i]) && profile_.group.is_null()) {
      errors_.push_back(where.error("joint '" + names[i] + "' is both planned and fixed"));
    } else if (std::ranges::find(planned_, names[i], &Joint::name) != planned_.end()) {
      errors_.push_back(where.error("joint '" + names[i] + "' is planned twice"));
    } else {
      planned_.push_back(with_limits(*joint, chosen ? &where : nullptr));
    }
  }
  if (planned_.empty() && errors_.empty()) {
    errors_.push_back(
        {ErrorCode::kConfig, "the robot has no joint that could be planned", model_.file.string()});
  }
}

std::pair<double, double> JointTable::base_limits(const std::string& name) const {
  const auto joint = std::ranges::find(planned_, name, &Joint::name);
  if (joint == planned_.end()) return {-kInfinity, kInfinity};
  return {joint->lower, joint->upper};
}

bool JointTable::is_of_base(const std::string& name) const {
  return profile_.base.drives() && std::ranges::count(profile_.base.joints, name) > 0;
}

std::optional<RollingBase> JointTable::rolling() const {
  if (profile_.base.type != "differential") return {};
  RollingBase base;
  for (const auto& [joint, number] : {std::pair(&base.x, 0), {&base.y, 1}, {&base.yaw, 2}}) {
    const auto at = std::ranges::find(planned_, base_joint(idx(number)).name, &Joint::name);
    if (at == planned_.end()) return {};  // held
    *joint = static_cast<int>(at - planned_.begin());
  }
  return base;
}

std::map<std::string, std::set<std::string>> JointTable::read_groups() {
  const Node& node = profile_.groups;
  if (!node.is_map() && !node.is_null()) {
    errors_.push_back(
        node.error("'groups' is a map from names to lists of joints, found " + node.kind()));
  }
  std::vector<std::string> names;
  for (const Joint& joint : of_profile_) names.push_back(joint.name);
  std::map<std::string, std::set<std::string>> groups;
  for (const Node::Entry& entry : node.entries()) {
    if (!entry.value.is_list() || entry.value.items().empty()) {
      errors_.push_back(
          entry.value.error("a group is a list of joints, found " + entry.value.kind()));
      continue;
    }
    std::set<std::string>& group = groups[entry.key];
    std::size_t of_base = 0;
    for (const Node& item : entry.value.items()) {
      if (std::ranges::count(names, item.text()) == 0) {
        errors_.push_back(item.error("the robot plans no joint '" + item.text() + "'",
                                     did_you_mean(item.text(), names)));
      } else if (!group.insert(item.text()).second) {
        errors_.push_back(item.error("joint '" + item.text() + "' is in the group twice"));
      } else {
        of_base += is_of_base(item.text()) ? 1 : 0;
      }
    }
    if (of_base != 0 && of_base != profile_.base.joints.size()) {
      errors_.push_back(entry.value.error("a group has all joints of the base, or none of them"));
    }
  }
  return groups;
}

void JointTable::choose_group(const std::map<std::string, std::set<std::string>>& groups) {
  const std::string& name = profile_.group.text();
  const auto group = groups.find(name);
  if (group == groups.end()) {
    std::vector<std::string> names;
    for (const auto& [known, joints] : groups) names.push_back(known);
    errors_.push_back(profile_.group.error("the robot profile has no group '" + name + "'",
                                           did_you_mean(name, names)));
    return;
  }
  for (const std::string& joint : group->second) {
    if (!fixed_.contains(joint)) continue;
    errors_.push_back(
        profile_.fixed_joints.error("joint '" + joint + "' is both planned and fixed"));
  }
  hold(group->second);
}

void JointTable::hold(const std::set<std::string>& group) {
  const Node none;
  const Node* pose = &none;
  if (!profile_.held.is_null()) {
    pose = profile_.poses.find(profile_.held.text());
    if (pose == nullptr) {
      std::vector<std::string> names;
      for (const Node::Entry& entry : profile_.poses.entries()) names.push_back(entry.key);
      errors_.push_back(
          profile_.held.error("the robot profile has no pose '" + profile_.held.text() + "'",
                              did_you_mean(profile_.held.text(), names)));
      return;
    }
  }
  for (std::size_t j = 0; j < of_profile_.size(); ++j) {
    const std::string& name = of_profile_[j].name;
    if (group.contains(name) || fixed_.contains(name)) continue;
    const bool is_in_list = pose->is_list() && j < pose->items().size();
    const Node* at = is_in_list ? &pose->items()[j] : pose->find(name);
    const auto value = at != nullptr ? at->as_double() : Result<double>(0.0);
    // What is wrong with it is told where poses are read, of all joints of the profile.
    if (at != nullptr && value) fixed_[name] = *value;
  }
  std::erase_if(planned_, [&](const Joint& joint) { return !group.contains(joint.name); });
}

double JointTable::held_at(const std::string& name) const {
  if (const auto it = fixed_.find(name); it != fixed_.end()) return it->second;
  const UrdfJoint* joint = model_.find_joint(name);
  return joint != nullptr ? rest_value(*joint) : 0.0;
}

TreeJoint JointTable::base_joint(std::size_t number) const {
  TreeJoint joint{profile_.base.joints[number],
                  number == 2 ? TreeJoint::Motion::kRotation : TreeJoint::Motion::kTranslation};
  const auto it = std::ranges::find(planned_, joint.name, &Joint::name);
  if (it != planned_.end()) {
    joint.joint = static_cast<int>(it - planned_.begin());
  } else {
    joint.offset = held_at(joint.name);
  }
  return joint;
}

std::optional<Joint> JointTable::head_joint(const std::string& name, const Node& where) {
  const UrdfJoint* joint = model_.find_joint(name);
  const bool turns = joint != nullptr && (joint->type == UrdfJoint::Type::kRevolute ||
                                          joint->type == UrdfJoint::Type::kContinuous);
  if (joint == nullptr) {
    errors_.push_back(unknown_joint(where, name));
  } else if (!turns || joint->mimic) {
    errors_.push_back(where.error("joint '" + name + "' does not turn a head: it is " +
                                  (turns ? "a mimic of another" : "not revolute")));
  } else if (std::ranges::find(planned_, name, &Joint::name) != planned_.end()) {
    errors_.push_back(where.error("joint '" + name + "' is planned, a head cannot turn it"));
  } else {
    return with_limits(*joint, &where);
  }
  return {};
}

Joint JointTable::with_limits(const UrdfJoint& joint, const Node* where) {
  const auto override_of = limits_.find(joint.name);
  const JointLimitOptions own =
      override_of == limits_.end() ? JointLimitOptions{} : override_of->second;
  Joint out{joint.name, planned_type(joint.type)};
  const SourceMark mark = where != nullptr && where->mark().line > 0 ? where->mark() : joint.mark;
  const auto missing = [&](const std::string& what) {
    errors_.push_back({ErrorCode::kConfig,
                       "joint '" + joint.name + "' has no " + what + " in the URDF (" +
                           joint.mark.to_string() + ")",
                       mark.to_string(), "give it under 'joint_limits'"});
  };
  if (joint.type == UrdfJoint::Type::kContinuous) {
    out.lower = own.lower.value_or(-kInfinity);
    out.upper = own.upper.value_or(kInfinity);
    if (own.lower && own.upper) out.type = Joint::Type::kRevolute;
  } else if (!joint.limits && !(own.lower && own.upper)) {
    missing("position limits");
  } else {
    out.lower = own.lower ? *own.lower : joint.limits->lower;
    out.upper = own.upper ? *own.upper : joint.limits->upper;
  }
  if (out.lower > out.upper) {
    errors_.push_back({ErrorCode::kConfig,
                       "joint '" + joint.name + "' has its lower limit above its upper one",
                       mark.to_string()});
  }
  out.max_velocity = own.max_velocity ? *own.max_velocity
                     : joint.limits   ? joint.limits->velocity
                                      : 0.0;
  if (!(out.max_velocity > 0.0)) missing("velocity limit above zero");
  out.max_acceleration = own.max_acceleration.value_or(kInfinity);
  out.max_braking = own.max_braking;
  return out;
}

double JointTable::rest_value(const UrdfJoint& joint) const {
  const auto it = fixed_.find(joint.name);
  if (it != fixed_.end()) return it->second;
  const auto [lower, upper] = position_limits(joint);
  return lower > upper ? 0.0 : std::clamp(0.0, lower, upper);
}

TreeJoint JointTable::tree_joint(const UrdfJoint& joint) const {
  TreeJoint out;
  out.name = joint.name;
  out.T_parent_joint = joint.T_parent_joint;
  if (joint.type == UrdfJoint::Type::kFixed) return out;
  out.motion = joint.type == UrdfJoint::Type::kPrismatic ? TreeJoint::Motion::kTranslation
                                                         : TreeJoint::Motion::kRotation;
  out.axis = joint.axis;
  // value = multiplier * master + offset, through every joint that mimics another.
  const UrdfJoint* master = &joint;
  while (master->mimic) {
    out.offset += out.multiplier * master->mimic->offset;
    out.multiplier *= master->mimic->multiplier;
    const UrdfJoint* next = model_.find_joint(master->mimic->joint);
    if (next == nullptr) break;  // above the chosen root: it stays at zero
    master = next;
  }
  const auto it = std::ranges::find(planned_, master->name, &Joint::name);
  if (it != planned_.end()) {
    out.joint = static_cast<int>(it - planned_.begin());
  } else {
    out.offset += out.multiplier * (master->mimic ? 0.0 : rest_value(*master));
    out.multiplier = 1.0;
  }
  return out;
}

}  // namespace sidestep::urdf_robot
