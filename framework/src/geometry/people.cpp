#include <sidestep/core/file.hpp>
#include <sidestep/geometry/people.hpp>

#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>

#include <sidestep/core/index.hpp>

#include "node_reader.hpp"

namespace sidestep {
namespace {

using Policy = Person::Policy;
using Sees = Person::Sees;

struct PolicyName {
  const char* name;
  Policy policy;
};
constexpr PolicyName kPolicies[] = {{"waypoints", Policy::kWaypoints},
                                    {"orca", Policy::kOrca},
                                    {"social_force", Policy::kSocialForce},
                                    {"recorded", Policy::kRecorded},
                                    {"sudden", Policy::kSudden},
                                    {"hunter", Policy::kHunter}};
struct SeesName {
  const char* name;
  Sees sees;
};
constexpr SeesName kSees[] = {
    {"never", Sees::kNever}, {"always", Sees::kAlways}, {"in_front", Sees::kInFront}};

constexpr double kLargestId = 9e15;  // a double counts so far

/// One number of a line of comma-separated ones; advances past it and its comma.
std::optional<double> next_number(const char*& at) {
  char* end = nullptr;
  const double value = std::strtod(at, &end);
  while (*end == ' ' || *end == '\r') ++end;
  if (end == at || !std::isfinite(value) || (*end != ',' && *end != '\0')) return {};
  at = *end == ',' ? end + 1 : end;
  return value;
}

class PeopleReader : private NodeReader {
 public:
  explicit PeopleReader(std::vector<Error>& errors) : NodeReader(errors) {}

  People read(const Node& block) {
    People people;
    if (!block.is_map()) {
      add(block.error("expected people such as {groups: [{name: guest, count: 3, ...}]}, found " +
                      block.kind()));
      return people;
    }
    check_keys(block, {"step_s", "duration_s", "groups"});
    read_positive(block, "step_s", people.step_s);
    read_positive(block, "duration_s", people.duration_s);
    const Node* groups = require(block, "groups", "the people of a scene");
    if (groups == nullptr) return people;
    if (!groups->is_list()) {
      add(groups->error("expected a list of groups, found " + groups->kind()));
    }
    for (const Node& group : groups->items()) read_group(group, people);
    return people;
  }

 private:
  void read_group(const Node& node, People& people) {
    PeopleGroup group;
    group.mark = node.mark();
    if (!node.is_map()) {
      add(node.error("expected a group of people, which is a map, found " + node.kind()));
      return;
    }
    Person& person = group.common;
    read_name(node, person);
    read_policy(node, person);
    read_range(node, "radius_m", group.radius_m);
    read_range(node, "speed_mps", group.speed_mps);
    read_positive(node, "height_m", person.height_m);
    if (const Node* legs = node.find("legs")) {
      person.has_legs = keep(legs->as_bool()).value_or(true);
    }
    if (person.policy == Policy::kRecorded) {
      check_keys(node, {"name", "policy", "file", "from_s", "centred", "walk_in_s", "radius_m",
                        "height_m", "legs"});
      if (group.radius_m.x() < group.radius_m.y()) {
        add(node.find("radius_m")->error("recorded people are all as large: expected a number"));
      }
      person.radius_m = group.radius_m.x();
      read_recording(node, person, people);
      return;
    }
    if (person.policy == Policy::kSudden) {
      check_keys(node, {"name", "policy", "size_m", "height_m", "after_m", "ahead_m", "area"});
      read_sudden(node, group);
      people.groups.push_back(std::move(group));
      return;
    }
    if (person.policy == Policy::kHunter) {
      check_keys(node, {"name", "count", "policy", "radius_m", "speed_mps", "height_m", "legs",
                        "wakes_m", "route_m", "area"});
      read_range(node, "wakes_m", group.wakes_m);
    } else {
      check_keys(node, {"name", "count", "policy", "radius_m", "speed_mps", "height_m", "legs",
                        "sees_robot", "blind_share", "route_m", "repeat", "area"});
      read_sight(node, group);
    }
    if (const Node* count = node.find("count")) {
      const auto value = keep(count->as_int());
      if (value && (*value < 1 || *value > 1000)) {
        add(count->error("count must be from 1 to 1000, found " + count->text()));
      }
      group.count = static_cast<int>(std::clamp<std::int64_t>(value.value_or(1), 1, 1000));
    }
    if (const Node* repeat = node.find("repeat")) {
      person.repeats = keep(repeat->as_bool()).value_or(false);
    }
    read_ways(node, group);
    people.groups.push_back(std::move(group));
  }

  void read_name(const Node& node, Person& person) {
    const Node* name = require(node, "name", "a group of people");
    if (name == nullptr) return;
    person.name = keep(name->as_string()).value_or("");
    if (name->is_scalar() && person.name.empty()) add(name->error("a group's name is empty"));
    if (!person.name.empty() && !names_.insert(person.name).second) {
      add(name->error("another group is named '" + person.name + "' already"));
    }
  }

  void read_policy(const Node& node, Person& person) {
    const Node* policy = require(node, "policy", "a group of people");
    if (policy == nullptr) return;
    read_choice(*policy, "policy", kPolicies, person.policy, &PolicyName::policy);
  }

  template <class Names, class Value, class Member>
  void read_choice(const Node& node, const std::string& what, const Names& choices, Value& into,
                   Member member) {
    std::vector<std::string> names;
    for (const auto& choice : choices) {
      if (node.text() == choice.name) {
        into = choice.*member;
        return;
      }
      names.emplace_back(choice.name);
    }
    add(node.error("there is no " + what + " '" + node.text() + "'",
                   did_you_mean(node.text(), names, "there are: " + joined(names))));
  }

  void read_sight(const Node& node, PeopleGroup& group) {
    if (const Node* sees = node.find("sees_robot")) {
      read_choice(*sees, "value of sees_robot", kSees, group.common.sees_robot, &SeesName::sees);
    }
    if (const Node* share = node.find("blind_share")) {
      group.blind_share = keep(share->as_double()).value_or(0.0);
      if (group.blind_share < 0.0 || group.blind_share > 1.0) {
        add(share->error("blind_share must be from 0 to 1, found " + share->text()));
      }
    }
  }

  void read_positive(const Node& map, const std::string& key, double& into) {
    if (const Node* node = map.find(key)) into = positive(*node, key);
  }

  /// A number greater than zero, or a range of such.
  void read_range(const Node& map, const std::string& key, Eigen::Vector2d& into) {
    const Node* node = map.find(key);
    if (node == nullptr) return;
    if (node->is_scalar()) {
      into.setConstant(positive(*node, key));
      return;
    }
    const auto values = range(*node, key);
    if (!values) return;
    if (!(values->first > 0.0)) add(node->error(key + " must be greater than 0"));
    into = {values->first, values->second};
  }

  void read_ways(const Node& node, PeopleGroup& group) {
    const Node* route = node.find("route_m");
    const Node* area = node.find("area");
    if ((route == nullptr) == (area == nullptr)) {
      add(node.error("a group of people has either a 'route_m' or an 'area' to walk in"));
      return;
    }
    if (area != nullptr) {
      read_area(*area, group);
      return;
    }
    if (!route->is_list() || route->items().empty()) {
      add(route->error("expected a list of places, the first of them the start, found " +
                       (route->is_list() ? "an empty one" : route->kind())));
      return;
    }
    for (const Node& item : route->items()) {
      const auto place = keep(item.as_doubles(2));
      if (place) group.common.route_m.emplace_back((*place)[0], (*place)[1]);
    }
    if (group.count > 1) {
      add(node.find("count")->error("a group whose 'route_m' is given is one person"));
    }
  }

  void read_sudden(const Node& node, PeopleGroup& group) {
    Person& person = group.common;
    person.has_legs = false;
    person.box_m.emplace(0.2, 0.4);
    if (const Node* size = node.find("size_m"); size != nullptr && keep(size->as_doubles(2))) {
      for (int axis = 0; axis < 2; ++axis) {
        (*person.box_m)[axis] = positive(size->items()[idx(axis)], "size_m");
      }
    }
    group.radius_m.setConstant(0.5 * person.box_m->norm());
    read_range(node, "after_m", group.after_m);
    read_positive(node, "ahead_m", person.ahead_m);
    person.area = {Eigen::Vector2d::Constant(-kInfinity), Eigen::Vector2d::Constant(kInfinity)};
    if (const Node* area = node.find("area")) read_area(*area, group);
  }

  void read_area(const Node& area, PeopleGroup& group) {
    if (!area.is_map()) {
      add(area.error("expected an area such as {x_m: [-2, 2], y_m: [-2, 2]}, found " +
                     area.kind()));
      return;
    }
    check_keys(area, {"x_m", "y_m"});
    const Node* x = require(area, "x_m", "an area");
    const Node* y = require(area, "y_m", "an area");
    if (x == nullptr || y == nullptr) return;
    const auto along_x = range(*x, "x_m"), along_y = range(*y, "y_m");
    if (!along_x || !along_y) return;
    group.common.area = {Eigen::Vector2d(along_x->first, along_y->first),
                         Eigen::Vector2d(along_x->second, along_y->second)};
  }

  void read_recording(const Node& node, const Person& common, People& people) {
    double from_s = 0.0;
    if (const Node* from = node.find("from_s")) from_s = keep(from->as_double()).value_or(0.0);
    bool is_centred = false;
    if (const Node* centred = node.find("centred")) {
      is_centred = keep(centred->as_bool()).value_or(false);
    }
    const Node* file = require(node, "file", "a recording");
    const auto path = file != nullptr ? keep(file->as_path()) : std::nullopt;
    if (!path) return;
    const auto text = read_file(*path);
    if (!text) {
      add(text.error().wrapped(ErrorCode::kConfig, "the recording cannot be read",
                               file->mark().to_string()));
      return;
    }
    std::istringstream in(*text);
    std::map<std::int64_t, std::size_t> persons;
    std::string line;
    std::size_t number = 0;
    const auto mistake = [&](const std::string& what) {
      add({ErrorCode::kConfig, what, path->string() + ":" + std::to_string(number),
           "a line is: person,time_s,x_m,y_m", nullptr});
    };
    while (std::getline(in, line)) {
      ++number;
      if (line.empty() || line[0] == '#') continue;
      const bool is_header = persons.empty() && line.starts_with("person,");
      if (is_header) continue;
      const char* at = line.c_str();
      const auto id = next_number(at), time_s = next_number(at), x = next_number(at),
                 y = next_number(at);
      const bool is_whole = at == line.c_str() + line.size();
      const bool is_id = id && std::floor(*id) == *id && std::abs(*id) < kLargestId;
      if (!is_id || !time_s || !x || !y || !is_whole) {
        return mistake("expected the number of a person and three finite numbers, found '" + line +
                       "'");
      }
      const auto [known, is_new] =
          persons.emplace(static_cast<std::int64_t>(*id), people.persons.size());
      if (is_new) {
        people.persons.push_back(common);
        people.persons.back().name += "_" + std::to_string(known->first);
      }
      auto& recorded = people.persons[known->second].recorded;
      const double shifted_s = *time_s - from_s;
      if (!recorded.empty() && shifted_s <= recorded.back().time_s) {
        return mistake("the times of person " + std::to_string(known->first) + " do not increase");
      }
      recorded.push_back({shifted_s, {*x, *y}});
    }
    if (persons.empty()) {
      ++number;
      mistake("there is nobody in the recording");
    }
    const std::size_t first = people.persons.size() - persons.size();
    if (is_centred) centre(people, first);
    double walk_in_s = 0.0;
    read_positive(node, "walk_in_s", walk_in_s);
    for (std::size_t i = first; i < people.persons.size() && walk_in_s > 0.0; ++i) {
      walk_in(people.persons[i].recorded, walk_in_s);
    }
  }

  /// Has somebody come for so long before the recording begins, at the first velocity in it.
  static void walk_in(std::vector<TimedPlace>& recorded, double walk_in_s) {
    if (recorded.size() < 2) return;
    const TimedPlace &first = recorded[0], &second = recorded[1];
    const Eigen::Vector2d velocity_mps =
        (second.place_m - first.place_m) / (second.time_s - first.time_s);
    recorded.insert(recorded.begin(),
                    {first.time_s - walk_in_s, first.place_m - walk_in_s * velocity_mps});
  }

  /// Moves the persons from one number on so that the mean of their places is the origin.
  static void centre(People& people, std::size_t first) {
    Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
    double count = 0.0;
    for (std::size_t i = first; i < people.persons.size(); ++i) {
      for (const TimedPlace& at : people.persons[i].recorded) {
        mean_m += (at.place_m - mean_m) / ++count;
      }
    }
    for (std::size_t i = first; i < people.persons.size(); ++i) {
      for (TimedPlace& at : people.persons[i].recorded) at.place_m -= mean_m;
    }
  }

  std::set<std::string> names_;
};

}  // namespace

People read_people(const Node& block, std::vector<Error>& errors) {
  return PeopleReader(errors).read(block);
}

}  // namespace sidestep
