# Record of each case of config/cases.tsv.
wildcard_constraints:
    case="|".join(re.escape(case) for case in STUDY.cases),


rule record:
    priority: 2  # all else waits for records
    input:
        model=model_of,
        code=CODE["record"],
    output:
        record="results/{case}/record.csv",
    params:
        settings=record_settings,
    benchmark:
        "results/benchmarks/record.{case}.tsv"
    run:
        step("make_record", input, output, params, wildcards)
