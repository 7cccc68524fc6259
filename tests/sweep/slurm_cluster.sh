# Sourced by what needs Slurm: begin_cluster FOLDER starts a cluster of this machine alone, which only listens on it, and
# sets SLURM_CONF; it ends with the shell. Fails where it does not come up.
begin_cluster() {
  local folder=$1 host
  host=$(hostname -s)
  mkdir -p "$folder/state" "$folder/spool"
  export SLURM_CONF=$folder/slurm.conf
  cat >"$SLURM_CONF" <<EOF
ClusterName=sidestep
SlurmctldHost=$host(127.0.0.1)
SlurmUser=$(id -un)
SlurmdUser=$(id -un)
SlurmctldPort=$2
SlurmdPort=$(($2 + 1))
AuthType=auth/none
CredType=cred/none
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
MpiDefault=none
SchedulerParameters=sched_interval=1
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
NodeName=$host NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES State=UP
EOF
  slurmctld -D >"$folder/out" 2>&1 &
  cluster=$!
  slurmd -D >>"$folder/out" 2>&1 &
  cluster="$cluster $!"
  trap end_cluster EXIT
  for _ in $(seq 60); do
    if [ "$(sinfo -h -o %t 2>/dev/null)" = idle ]; then return; fi
    sleep 0.5
  done
  cat "$folder/out"
  return 1
}

# What keeps a job's last process asks for the controller until that has heard of its end: jobs end first.
end_cluster() {
  scancel --user="$(id -un)" || true
  for _ in $(seq 60); do
    [ -n "$(squeue --noheader)" ] || break
    sleep 0.5
  done
  kill $cluster
  wait $cluster
}
