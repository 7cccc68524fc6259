#pragma once

#include <map>
#include <memory>
#include <utility>

#include <sidestep/problems/recorded_problems.hpp>

namespace sidestep {

/// The fields of a file of recorded problems, each made when it is first asked for. The problems
/// must outlive them.
class RecordedFields {
 public:
  explicit RecordedFields(const RecordedProblems& problems) : problems_(problems) {}

  const std::shared_ptr<const DistanceField>& of(int scene, bool is_signed) {
    auto& field = fields_[{scene, is_signed}];
    if (field == nullptr) field = recorded_field(problems_, scene, is_signed);
    return field;
  }

 private:
  const RecordedProblems& problems_;
  std::map<std::pair<int, bool>, std::shared_ptr<const DistanceField>> fields_;
};

}  // namespace sidestep
