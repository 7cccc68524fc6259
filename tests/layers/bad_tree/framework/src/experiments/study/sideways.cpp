#include "mapping/mapping_settings.hpp"
#include "results/recorder.hpp"
#include "study/study_rows.hpp"
