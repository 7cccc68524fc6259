#include <sidestep/experiments/report.hpp>
#include <sidestep/results/json.hpp>
#include "replan_rows.hpp"
#include "study_rows.hpp"
