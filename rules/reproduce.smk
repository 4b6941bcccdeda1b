# Record and identification of each case of config/cases.tsv.
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
    script:
        "../scripts/make_record.py"


rule identify:
    input:
        model=model_of,
        record="results/{case}/record.csv",
        code=CODE["identify"],
    output:
        responses="results/{case}/frequency_response.csv",
        coherences="results/{case}/coherence.csv",
        noise="results/{case}/noise.csv",
        parameters="results/{case}/parameters.csv",
    params:
        settings=identification_settings,
    benchmark:
        "results/benchmarks/identify.{case}.tsv"
    script:
        "../scripts/identify.py"
