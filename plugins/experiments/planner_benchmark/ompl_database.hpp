#pragma once

#include <filesystem>

#include <sidestep/core/error.hpp>

#include "planner_rows.hpp"

namespace sidestep {

/// Name of the file in a run's folder.
inline constexpr const char* kOmplDatabase = "ompl_benchmark.db";

/// Writes a benchmark the way OMPL's own benchmarks are stored (OMPL 1.5, SQLite), for
/// ompl_benchmark_statistics and Planner Arena; replaces the file. A family is an experiment, an
/// answer to one of its problems with one seed is a run: solved where the independent check accepts
/// it. `progress` has the length of the path that was best so far at 50 times up to the deadline.
/// Fails with kIo.
[[nodiscard]] Result<void> write_ompl_database(const PlannerBenchmarkRecord& record,
                                               const std::filesystem::path& file);

}  // namespace sidestep
